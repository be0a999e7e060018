"""What a drive's own configuration must be, as the robot's file asks.

Names are those of the firmware's ``conf get`` and ``conf set``.
"""

import math
from dataclasses import dataclass

from hopping_leg.deploy.joint_transform import JOINTS, joint_transforms
from hopping_leg.robot.parameters import Robot

BRAKE_MODE = 15
"""What a drive shall do when its watchdog ends a torque command; the firmware's default is limp."""

_RELATIVE = 1e-3


@dataclass(frozen=True)
class Setting:
    """One entry of a drive's configuration.

    Attributes:
        name: As the firmware calls it.
        value: As wanted.
        why: What depends on it.
    """

    name: str
    value: float
    why: str

    def holds(self, found: float) -> bool:
        """Tell whether a drive's value is the wanted one, within the rounding of its text."""
        return math.isclose(found, self.value, rel_tol=_RELATIVE, abs_tol=1e-6)

    @property
    def text(self) -> str:
        """The value as ``conf set`` takes it."""
        return f"{self.value:.9g}"


def wanted(robot: Robot, joint: int) -> tuple[Setting, ...]:
    """Return the configuration of one joint's drive.

    Args:
        robot: Whose drives.
        joint: 0 for the hip, 1 for the knee.
    """
    servo, transform = robot.hardware.servos[joint], joint_transforms(robot)[joint]
    motor = getattr(robot, JOINTS[joint]).motor
    ends = sorted(transform.motor_position(angle) for angle in (servo.lower, servo.upper))
    return (
        Setting("motor_position.rotor_to_output_ratio", 1 / motor.gear_ratio, "gear ratio"),
        Setting("servopos.position_min", ends[0], "mechanical stop"),
        Setting("servopos.position_max", ends[1], "mechanical stop"),
        Setting("servo.max_current_A", servo.max_current, "motor current"),
        Setting("servo.timeout_mode", BRAKE_MODE, "brakes when the host is silent"),
        Setting("servo.default_timeout_s", robot.hardware.watchdog, "watchdog"),
    )
