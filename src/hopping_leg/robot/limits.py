"""What the joints may do: the motors' torque-speed limit and the paper's soft position limits."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.robot import dynamics, kinematics
from hopping_leg.robot.parameters import Robot

OVERSPEED = 1.3
"""Joint speed over the motor's no-load speed beyond which the supervisor stops the leg."""


def braking_times(robot: Robot, rate: float) -> Array:
    """Return how long before a mechanical stop hip and knee must be braked, s, (2,).

    A joint at the speed w turns on for a control period, 1 / rate in Hz, until the supervisor sees
    it. Then the drives short their windings, which brakes with c w, where c is the slope of the
    torque-speed line, so that the inertia I comes to rest after w I / c. The whole distance, rad,
    is w times a constant, the time returned:

        distance = w (1 / rate + I / c)

    I is the largest that a posture gives, the straight leg's on a base that is held. So the
    supervisor stops the leg where q + w (1 / rate + I / c) lies beyond a stop.
    """
    inertia = np.diag(dynamics.mass_matrix(robot, np.zeros(2)))[1:]
    _, _, slope = _torque_speed_line(robot)
    return np.asarray(1 / rate + inertia / slope)


def command_limits(robot: Robot) -> tuple[float, float]:
    """Return the heights a leg can be asked for, m: folded standing to twice its length."""
    folded = np.array([robot.hip.upper, robot.knee.lower])
    return float(kinematics.stance_height(robot, folded)), 2 * robot.straight_height


class MotorLimit:
    """Torque each joint's motor can give at a speed.

    The driving torque falls on the line from the peak torque at rest to zero at the no-load speed;
    the software limit caps it; braking is limited by the software limit alone.
    """

    def __init__(self, robot: Robot) -> None:
        self.limit, self.peak, self._slope = _torque_speed_line(robot)

    def clip(self, torque: Array, qd: Array) -> Array:
        """Return torques, N m, within what the motors can do at a speed, rad/s, (..., 2) each."""
        drop = self._slope * qd
        upper = np.clip(self.peak - drop, 0.0, self.limit)
        lower = np.clip(-self.peak - drop, -self.limit, 0.0)
        return np.clip(torque, lower, upper)


def _torque_speed_line(robot: Robot) -> Array:
    """Return software limit, peak torque and slope of both joints, (3, 2)."""
    joints = (robot.hip, robot.knee)
    peak = np.array([j.motor.peak_torque for j in joints]) * robot.of_joints("belt_ratio")
    slope = peak / robot.of_joints("no_load_speed")
    return np.stack([robot.of_joints("torque_limit"), peak, slope])


@dataclass(frozen=True)
class SoftLimits:
    """PD that pulls the joints back into bounds once they are passed (paper, Sec. II-C).

    It runs where the controller runs, on the same samples, and its torque goes the same way. The
    gains bear that: at 200 Hz every joint of the shipped legs swings back with a damping ratio of
    0.2 or more on samples that are one tick late, and is stable on those that are two late. With
    20 N m/rad a hip would ring without end at one tick; more than 0.15 N m s/rad shakes the shank
    of legv2-paper, whose armature is small.
    """

    stiffness: float = 8.0
    """Stiffness of the PD, N m/rad."""
    damping: float = 0.15
    """Damping of the PD, N m s/rad."""
    inset: float = 0.0
    """How far inside the limit the PD aims, rad."""
    replace: bool = False
    """Replace the controller's torque while outside, as printed, instead of adding to it."""
