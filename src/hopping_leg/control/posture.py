"""Joint PD towards a posture, reached on a smooth path."""

import numpy as np

from hopping_leg.arrays import Array


def smooth_step(share: Array) -> Array:
    """Return the path of least jerk from 0 to 1, still at both ends, (...)."""
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def smooth_step_rate(share: Array) -> Array:
    """Return the derivative of ``smooth_step``, (...)."""
    s = np.clip(share, 0.0, 1.0)
    return 30 * s**2 * (1 - s) ** 2


def joint_pd(error: Array, rate_error: Array, stiffness: Array, damping: Array) -> Array:
    """Return joint torques, N m, (n, 2).

    Args:
        error: Target minus position, rad, (n, 2).
        rate_error: Target minus velocity, rad/s, (n, 2).
        stiffness: N m/rad, (n, 2) or (2,).
        damping: N m s/rad, (n, 2) or (2,).
    """
    return stiffness * error + damping * rate_error
