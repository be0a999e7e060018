"""Between motor and joint: belt, sign, zero and revolutions. Units change here and nowhere else.

    q = s 2 pi p / b + q0        tau_motor = s tau_joint / b

with the motor's output position p in revolutions, belt ratio b, sign s and zero offset q0. The
joint's side is SI throughout; the motor's side is what moteus drives speak: revolutions, rev/s and
N m at the motor's output.
"""

import math
from dataclasses import dataclass

from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class JointTransform:
    """The way from one drive to its joint and back."""

    id: int
    """CAN id of the drive."""
    sign: float
    """1 or -1."""
    belt_ratio: float
    """Turns of the motor's output per turn of the joint."""
    zero_offset: float
    """Joint angle at motor position zero, rad."""

    def joint_position(self, revolutions: float) -> float:
        """Return the joint angle, rad, of a motor position, rev."""
        return self.joint_velocity(revolutions) + self.zero_offset

    def joint_velocity(self, revolutions_s: float) -> float:
        """Return the joint velocity, rad/s, of a motor velocity, rev/s."""
        return self.sign * math.tau * revolutions_s / self.belt_ratio

    def joint_torque(self, motor_torque: float) -> float:
        """Return the torque at the joint, N m, of one at the motor's output, N m."""
        return self.sign * motor_torque * self.belt_ratio

    def motor_position(self, angle: float) -> float:
        """Return the motor position, rev, of a joint angle, rad."""
        return self.motor_velocity(angle - self.zero_offset)

    def motor_velocity(self, velocity: float) -> float:
        """Return the motor velocity, rev/s, of a joint velocity, rad/s."""
        return self.sign * velocity * self.belt_ratio / math.tau

    def motor_torque(self, torque: float) -> float:
        """Return the torque at the motor's output, N m, of one at the joint, N m."""
        return self.sign * torque / self.belt_ratio


def joint_transforms(robot: Robot) -> tuple[JointTransform, JointTransform]:
    """Return the transforms of hip and knee."""
    pairs = zip(robot.hardware.servos, (robot.hip, robot.knee), strict=True)
    hip, knee = (
        JointTransform(int(servo.id), servo.sign, joint.belt_ratio, servo.zero_offset)
        for servo, joint in pairs
    )
    return hip, knee
