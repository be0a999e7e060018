"""The pieces of a physics step against what defines them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.sim import leg_physics

SEEDS = st.integers(0, 2**32 - 1)


def full(m):
    """Return the matrix of its six numbers."""
    return np.array([[m[0], m[1], m[2]], [m[1], m[3], m[4]], [m[2], m[4], m[5]]])


def random_matrix(rng):
    """Return six numbers of a positive definite matrix whose scales differ."""
    root = rng.normal(0, 1, (3, 3)) + 2 * np.eye(3)
    matrix = root @ root.T * np.outer(*[10 ** rng.uniform(-1, 0, 3)] * 2)
    matrix = (matrix + matrix.T) / 2
    return tuple(matrix[np.triu_indices(3)])


@given(SEEDS, st.integers(0, leg_physics.ROWS), st.integers(0, 7))
@settings(max_examples=300)
def test_the_acceleration_obeys_gauss_principle(seed, count, sliding):
    """At the minimum, mass times acceleration is force plus what the constraints give."""
    rng = np.random.default_rng(seed)
    m, force, start = random_matrix(rng), *rng.normal(0, [[100.0], [1000.0]], (2, 3))
    loss = np.where([sliding >> i & 1 for i in range(3)], 10 ** rng.uniform(-2, 2, 3), 0.0)
    stiff, rest = 10 ** rng.uniform(0, 3, 3), rng.normal(0, 100, 3)
    rows = np.zeros((leg_physics.ROWS, 5))
    rows[:count] = rng.normal(0, 1, (count, 5)) * [1, 1, 1, 100, 0]
    rows[:count, 4] = 10 ** rng.uniform(-1, 3, count)
    friction = tuple(map(tuple, (loss, stiff, rest, loss / stiff)))
    a = leg_physics.constrained_acceleration(m, tuple(force), friction, rows, count, tuple(start))
    miss = np.minimum(rows[:count, :3] @ a - rows[:count, 3], 0.0)
    given_by_rows = -(rows[:count, 4] * miss) @ rows[:count, :3]
    given_by_friction = np.clip(-stiff * (a - rest), -loss, loss)
    residual = full(m) @ a - force - given_by_rows - given_by_friction
    scale = np.abs(full(m)) @ np.abs(a) + np.abs(force) + np.abs(given_by_rows)
    assert (np.abs(residual) <= 1e-8 * scale.max()).all()
