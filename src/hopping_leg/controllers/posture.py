"""Flight: the joints move to the landing posture on a smooth path, held there by a PD."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.shaping_gains import Gain


def smooth_step(share: Array) -> Array:
    """Return the path of least jerk from 0 to 1, at rest at both ends, (...)."""
    s = np.clip(share, 0.0, 1.0)
    path: Array = s**3 * (10 - 15 * s + 6 * s**2)
    return path


def smooth_step_rate(share: Array) -> Array:
    """Return the derivative of ``smooth_step``, (...)."""
    s = np.clip(share, 0.0, 1.0)
    rate: Array = 30 * s**2 * (1 - s) ** 2
    return rate


def retraction(start: Array, end: Array, elapsed: Array, duration: Gain) -> tuple[Array, Array]:
    """Return where the joints should be and how fast, rad and rad/s, (n, 2).

    Args:
        start: Joint positions at lift-off, rad, (n, 2).
        end: Landing posture, rad, (n, 2).
        elapsed: Time since lift-off, s, (n,).
        duration: Of the movement, s.
    """
    lasts = np.broadcast_to(duration, elapsed.shape)[:, None]
    share = elapsed[:, None] / lasts
    return start + (end - start) * smooth_step(share), (end - start) * smooth_step_rate(
        share
    ) / lasts


def per_joint(hip: Gain, knee: Gain) -> Array:
    """Return a gain of both joints, (2,) or (n, 2)."""
    return np.stack(np.broadcast_arrays(np.asarray(hip, float), np.asarray(knee, float)), axis=-1)
