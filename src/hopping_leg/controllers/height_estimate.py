"""Base height from joint measurements alone (paper, "Jumping height estimation", Eq. 8).

Heights are those of the hip axis above the ground. Gravity is 9.81 m/s2 and points down; the
paper's formula holds with g = -9.81 m/s2 and shortens to x_l + x'_l s + g s^2 / 2, s = t - t_l.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot.model import GRAVITY


def ballistic_height(liftoff_height: Array, liftoff_rate: Array, airborne: Array) -> Array:
    """Return the height in free flight, m, (n,).

    Args:
        liftoff_height: x_l, m, (n,).
        liftoff_rate: Base velocity at lift-off, m/s, (n,).
        airborne: Time since lift-off, s, (n,).
    """
    return liftoff_height + liftoff_rate * airborne - 0.5 * GRAVITY * airborne**2


def ballistic_apex(liftoff_height: Array, liftoff_rate: Array) -> Array:
    """Return the highest point of the paper's parabola, m, (n,)."""
    return liftoff_height + np.maximum(liftoff_rate, 0.0) ** 2 / (2 * GRAVITY)


def flight_time_apex(liftoff_height: Array, touchdown_height: Array, airborne: Array) -> Array:
    """Return the apex of the parabola through lift-off and touchdown, m, (n,).

    Both heights and the time between them fix the speed at lift-off, which itself is noisy.

    Args:
        liftoff_height: Leg length and foot radius at lift-off, m, (n,).
        touchdown_height: The same at touchdown, m, (n,).
        airborne: Time between the two, s, (n,); must be positive.
    """
    speed = (touchdown_height - liftoff_height) / airborne + 0.5 * GRAVITY * airborne
    return ballistic_apex(liftoff_height, speed)
