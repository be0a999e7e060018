"""What names its state goes on exactly where another one was."""

import numpy as np

from hopping_leg.arrays import Stateful


class Walk(Stateful):
    STATE = ("at", "steps", "rng")
    at, steps, rng = np.zeros(2), [0], np.random.default_rng(0)


def test_a_state_is_a_copy_of_arrays_values_and_generators():
    walk, other = Walk(), Walk()
    walk.at, walk.steps, other.rng = np.array([0.0, 2.0]), [1], np.random.default_rng(1)
    state, drawn = walk.state(), walk.rng.random()
    walk.at[1], walk.steps[0] = 9.0, 9
    other.restore(state)
    assert (other.at.tolist(), other.steps, other.rng.random()) == ([0.0, 2.0], [1], drawn)
