"""What the joints may do: the motors' torque-speed limit and the paper's soft position limits."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot.parameters import Robot


class MotorLimit:
    """Torque each joint's motor can give at a speed.

    The driving torque falls on the line from the peak torque at rest to zero at the no-load
    speed; the software limit caps it; braking is limited by the software limit alone.
    """

    def __init__(self, robot: Robot) -> None:
        belt = robot.of_joints("belt_ratio")
        joints = (robot.hip, robot.knee)
        self.limit = robot.of_joints("torque_limit")
        self.peak = np.array([j.motor.peak_torque for j in joints]) * belt
        self._slope = self.peak / robot.of_joints("no_load_speed")

    def clip(self, torque: Array, qd: Array) -> Array:
        """Return the torque the motors give when asked for ``torque`` at speed ``qd``.

        Args:
            torque: At the joints, N m, (..., 2).
            qd: Joint velocity, rad/s, (..., 2).
        """
        drop = self._slope * qd
        upper = np.minimum(np.maximum(self.peak - drop, 0.0), self.limit)
        lower = np.maximum(np.minimum(-self.peak - drop, 0.0), -self.limit)
        return np.minimum(np.maximum(torque, lower), upper)


@dataclass(frozen=True)
class SoftLimits:
    """PD that pulls the joints back into bounds once they are passed (paper, Sec. II-C)."""

    stiffness: float = 20.0
    """N m/rad."""
    damping: float = 0.15
    """N m s/rad; above 2 I/dt of the shank a 200 Hz loop would ring."""
    inset: float = 0.0
    """How far inside the limit the PD aims, rad."""
    replace: bool = False
    """Replace the controller's torque while outside, as printed, instead of adding to it."""


class SoftLimiter:
    """Applies soft limits to a robot's joint torques."""

    def __init__(self, robot: Robot, soft: SoftLimits) -> None:
        self.soft = soft
        self._lower, self._upper = robot.of_joints("lower"), robot.of_joints("upper")

    def apply(self, torque: Array, q: Array, qd: Array) -> Array:
        """Return the torque with the PD in force where a joint is outside its limits.

        Args:
            torque: Asked for by the controller, N m, (..., 2).
            q: Joint position, rad, (..., 2).
            qd: Joint velocity, rad/s, (..., 2).
        """
        below, above = q < self._lower, q > self._upper
        outside = below | above
        if not outside.any():
            return torque
        soft = self.soft
        target = np.where(below, self._lower + soft.inset, self._upper - soft.inset)
        pull = soft.stiffness * (target - q) - soft.damping * qd
        inside_torque = 0.0 if soft.replace else torque
        return np.where(outside, pull + inside_torque, torque)
