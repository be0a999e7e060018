"""Perturbations unknown to the controller: other robots, pushes, uneven ground.

All of it is fixed before a run begins, so that every controller meets the same.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.leg_simulator import LegSimulator


@dataclass(frozen=True)
class Perturbation:
    """Perturbations of n legs in a run.

    Attributes:
        robots: What each leg is, whatever its controller believes, n of them.
        torque: Added to the torques asked for, N m, (ticks, n, 2).
        force: Upward push on the base, N, (ticks, n).
        ground: Where the ground is to be, m above where it was, (ticks, n); it moves under a leg
            as soon as the foot is clear of it.
    """

    robots: tuple[Robot, ...]
    torque: Array
    force: Array
    ground: Array


class Perturber:
    """Applies a perturbation, tick by tick, to legs that were made of its robots."""

    def __init__(self, perturbation: Perturbation, legs: LegSimulator) -> None:
        self.perturbation, self.legs = perturbation, legs
        self.ground = np.zeros(legs.count)
        """Where the ground is under each leg, m above where it was, (n,)."""
        self._force = np.zeros(legs.count)

    def act(self, tick: int) -> None:
        """Let happen what happens at the beginning of a tick."""
        plan, legs = self.perturbation, self.legs
        if (plan.force[tick] != self._force).any():
            self._force = plan.force[tick].copy()
            legs.push(self._force)
        rise = plan.ground[tick] - self.ground
        if rise.any():
            room = legs.foot_clearance() >= FLIGHT_CLEARANCE + np.maximum(rise, 0)
            rise = np.where(room, rise, 0.0)
            self.ground += rise
            legs.raise_ground(rise)
