"""How hard and how bouncy a landing was."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot.dynamics import potential_energy
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace


def ground_force(robot: Robot, trace: Trace) -> Array:
    """Return the force on the leg from outside but for gravity, N, (ticks,).

    It is the mass times the acceleration of the centre of mass plus gravity, from three ticks
    each; on the ground it is the ground's force but for the rail's small friction.

    Args:
        robot: The leg.
        trace: With true heights.
    """
    q = np.stack([trace.column(f"{joint}_position_rad") for joint in ("hip", "knee")], axis=1)
    weight = robot.mass * GRAVITY
    height = potential_energy(robot, trace.column("height_m"), q) / weight
    period = np.diff(trace.column("time_s")).mean()
    force = np.full(len(height), np.nan)
    force[1:-1] = weight + robot.mass * np.diff(height, 2) / period**2
    return force


def peak_force(robot: Robot, trace: Trace, start: int) -> float:
    """Return the largest force from a tick on, in weights of the leg."""
    return float(np.nanmax(ground_force(robot, trace)[start:]) / (robot.mass * GRAVITY))


def rebound(trace: Trace, touchdown: int) -> tuple[float, float]:
    """Return how far a landing bounced.

    Args:
        trace: Of a run that ends at rest.
        touchdown: Tick of the landing.

    Returns:
        Highest rise of the base above where it comes to rest, after its lowest point, and highest
        clearance of the foot after touchdown, m; zero where there is none.
    """
    height = trace.column("height_m")
    lowest = touchdown + int(height[touchdown:].argmin())
    over = float(height[lowest:].max() - height[-1])
    return max(over, 0.0), max(float(trace.column("foot_clearance_m")[touchdown:].max()), 0.0)


def last_touchdown(trace: Trace) -> int:
    """Return the tick at which the foot last met the ground; 0 if it never left."""
    clear = trace.column("foot_clearance_m") > 0
    met = np.flatnonzero(clear[:-1] & ~clear[1:])
    return int(met[-1]) + 1 if len(met) else 0
