"""What goes between the loop and the drives, at the joints, and what motors are told; SI."""

import math
from dataclasses import dataclass
from enum import Enum, IntEnum

from hopping_leg.robot.parameters import Robot

Pair = tuple[float, float]  # Values of hip and knee


class DriveMode(IntEnum):
    """State of a drive, register 0x000; 2 to 4 cannot be asked for."""

    STOPPED = 0
    FAULT = 1
    ENABLING = 2
    CALIBRATING = 3
    CALIBRATED = 4
    PWM = 5
    VOLTAGE = 6
    VOLTAGE_FOC = 7
    VOLTAGE_DQ = 8
    CURRENT = 9
    POSITION = 10
    """Also pure torque: with gains of zero."""
    TIMEOUT = 11
    ZERO_VELOCITY = 12
    STAY_WITHIN = 13
    MEASURE_INDUCTANCE = 14
    BRAKE = 15


class FaultCode(IntEnum):
    """Why a drive is in fault, register 0x00f."""

    CALIBRATION = 32
    MOTOR_DRIVER = 33
    OVER_VOLTAGE = 34
    ENCODER = 35
    MOTOR_NOT_CONFIGURED = 36
    PWM_CYCLE_OVERRUN = 37
    OVER_TEMPERATURE = 38
    START_OUTSIDE_LIMIT = 39
    UNDER_VOLTAGE = 40
    CONFIG_CHANGED = 41
    THETA_INVALID = 42
    POSITION_INVALID = 43
    DRIVER_ENABLE = 44
    STOP_POSITION_DEPRECATED = 45
    TIMING_VIOLATION = 46
    BEMF_FEEDFORWARD_NO_ACCEL_LIMIT = 47
    INVALID_LIMITS = 48
    POSITION_ERROR = 49
    VELOCITY_ERROR = 50


@dataclass(frozen=True, slots=True)
class Reply:
    """One drive's state.

    Attributes:
        position: Joint angle, rad.
        velocity: Joint velocity, rad/s.
        torque: At the joint, N m.
        mode: As in ``DriveMode``; others occur.
        fault: Code, 0 for none.
        voltage: Bus voltage, V.
        temperature: Drive's electronics, deg C.
        taken: When it was measured, s on the host's clock.
        ahead: What the drive's clock has gained on the host's, beyond what quartzes do, s.
        sensed: What a height sensor at its auxiliary ports reads; NaN without one.
    """

    position: float
    velocity: float
    torque: float
    mode: int
    fault: int
    voltage: float
    temperature: float
    taken: float
    ahead: float = 0.0
    sensed: float = math.nan


Replies = tuple[Reply | None, Reply | None]
"""Replies of hip and knee; None where no fresh reply came."""


class Action(Enum):
    """What the drives are told."""

    STOP = 0
    """Windings open; also clears faults and timeouts."""
    TORQUE = 1
    BRAKE = 2
    """Windings shorted: damps without encoder or host."""


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """What leaves for the drives."""

    action: Action
    torque: Pair = (0.0, 0.0)
    """At the joints, N m; zero unless the action is ``TORQUE``."""


STOP = DriveCommand(Action.STOP)
BRAKE = DriveCommand(Action.BRAKE)
LIMP = DriveCommand(Action.TORQUE)  # Torque control at zero torque


@dataclass(frozen=True, slots=True)
class Exchange:
    """What came back in a tick."""

    replies: Replies
    """Fresh ones: measured after this tick's question was asked."""
    late: tuple[tuple[int, Reply], ...] = ()
    """Drive (0 hip, 1 knee) and reply to an earlier tick that arrived now."""
    height: float = math.nan
    clearance: float = math.nan
    """Measured base height, and the foot's above the ground that follows, m; NaN if not new."""


@dataclass(frozen=True)
class JointTransform:
    """Between one motor and its joint: belt, sign, zero and revolutions.

        q = s 2 pi p / b + q0        tau_motor = s tau_joint / b

    with the motor's output position p in revolutions, belt ratio b, sign s and zero offset q0. The
    joint's side is SI; the motor's is what moteus drives speak: rev, rev/s and N m at its output.
    Units change here and nowhere else.
    """

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
