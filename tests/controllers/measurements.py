"""What controllers are shown, and what their legs did."""

import numpy as np

from hopping_leg.hop_detection import COLUMNS, find_hops
from hopping_leg.sim.channel import Measurement


def measurement(count):
    """Return a measurement of legs in any state, each with a command of its own."""
    q, qd = np.random.default_rng(0).normal(size=(2, count, 3, 2))
    command = np.full((count, 3), 0.3) + 0.01 * np.arange(count)[:, None]
    return Measurement(q, qd, command, np.zeros((count, 3)))


def steady(q, qd, command=0.3):
    """Return a measurement of one leg whose samples are all the same."""
    samples = (np.tile(np.array(values, float), (1, 3, 1)) for values in (q, qd))
    return Measurement(*samples, np.full((1, 3), command), np.zeros((1, 3)))


def hops_of(run, leg):
    """Return the hops of a leg in a rollout."""
    return find_hops(*(run.data[name][:, leg] for name in COLUMNS))
