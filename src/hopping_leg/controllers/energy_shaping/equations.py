"""The equations of energy shaping: the push (paper, "Controller design") and the estimated height.

Heights are those of the hip axis above the ground. Gravity is 9.81 m/s2 and points down; the
paper's height estimate (Eq. 8) holds with g = -9.81 m/s2 and shortens to x_l + x'_l s + g s^2 / 2,
s = t - t_l.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.energy_shaping.gains import Gain
from hopping_leg.robot import GRAVITY, Robot

SHORTEST_PUSH = 0.02  # least Delta x_l, m; the paper sets no bound for a leg almost extended
STEP = (0.7, 1.4)  # bounds of E_d / E_{j-1}: one missed touchdown must not spoil the gain
RANGE = (0.3, 4.0)  # bounds of k over its first value


def feedforward_force(robot: Robot, command: Array, length_0: Array, liftoff: Array) -> Array:
    """Return F_f = m g (x_d - x_0) / Delta x_l (paper, Eq. 3), N, (n,).

    x_d is the command; x_0 lies a foot radius above the leg length at the turning point, m, (n,).
    """
    rise = np.maximum(command - length_0 - robot.foot.radius, 0.0)
    return robot.mass * GRAVITY * rise / push_distance(length_0, liftoff)


def push_distance(length_0: Array, liftoff: Array) -> Array:
    """Return Delta x_l, at least ``SHORTEST_PUSH``, m, (n,)."""
    return np.maximum(liftoff - length_0, SHORTEST_PUSH)


def intended_rate(length: Array, length_0: Array, liftoff: Array, final: Array) -> Array:
    """Return the leg rate that a push should have at a leg length, m/s, (n,).

    An almost constant force makes the rate grow with the root of the distance; joint damping and
    the lighter load towards the end flatten it. Only the shape matters: the gain update makes up
    for a wrong ``final`` rate at lift-off. ``length_0`` is that of the turning point.
    """
    share = np.clip((length - length_0) / push_distance(length_0, liftoff), 0.0, 1.0)
    return final * np.sqrt(share * (2 - share))


def share_of_period(length: Array, rate: Array, liftoff: Array, period: float) -> Array:
    """Return how much of the coming control period passes before lift-off, 0 to 1, (n,)."""
    ahead = np.maximum(rate, 1e-3) * period
    return np.clip((liftoff - length) / ahead, 0.0, 1.0)


def updated_gain(gain: Array, desired: Array, reached: Array, exponent: Gain) -> Array:
    """Return k_j = k_{j-1} (E_d / E_{j-1})^2 with E = m g x (paper, Eqs. 1, 2 and 6), (n,).

    The gain is over its first value, heights are in m; the paper's exponent is 2.
    """
    step = np.clip(desired / np.maximum(reached, 1e-3), *STEP)
    return np.clip(gain * step**exponent, *RANGE)


def ballistic_height(liftoff_height: Array, liftoff_rate: Array, airborne: Array) -> Array:
    """Return the height in free flight from x_l at a time since lift-off, s, m, (n,)."""
    return liftoff_height + liftoff_rate * airborne - 0.5 * GRAVITY * airborne**2


def ballistic_apex(liftoff_height: Array, liftoff_rate: Array) -> Array:
    """Return the highest point of the paper's parabola, m, (n,)."""
    return liftoff_height + np.maximum(liftoff_rate, 0.0) ** 2 / (2 * GRAVITY)


def flight_time_apex(liftoff_height: Array, touchdown_height: Array, airborne: Array) -> Array:
    """Return the apex of the parabola through lift-off and touchdown, m, (n,).

    Both heights, m, and the positive time between them, s, fix the speed at lift-off, which itself
    is noisy.
    """
    speed = (touchdown_height - liftoff_height) / airborne + 0.5 * GRAVITY * airborne
    return ballistic_apex(liftoff_height, speed)
