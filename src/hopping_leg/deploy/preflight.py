"""Whether the drives may be armed: every check with a sentence that says why not.

Among the checks is each drive's own configuration, which must be as the robot's file asks. Names
of settings are those of the firmware's ``conf get`` and ``conf set``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.joint_transform import joint_transforms
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.deploy.stop_reasons import fault_text
from hopping_leg.errors import HardwareError
from hopping_leg.robot.hardware import REGISTER_MAP
from hopping_leg.robot.parameters import JOINTS, Robot

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


def required_settings(robot: Robot, joint: int) -> tuple[Setting, ...]:
    """Return the configuration of one joint's drive: 0 for the hip, 1 for the knee."""
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


HOMED = 2
"""Home state of a drive that knows where its output is (register 0x00c)."""


@dataclass(frozen=True)
class DriveInfo:
    """One drive before arming; joint side, SI.

    Attributes:
        answers: Whether it answers at all; if not, nothing else is known.
        firmware: Version of its firmware, as the register holds it.
        register_map: Version of its register map.
        serial: Serial number of its controller, 24 hex digits.
        home: 2 where it has been told where its output is.
        position: Joint angle as it believes, rad.
        mode: As in ``DriveMode``.
        fault: Code.
        voltage: Bus voltage, V.
        temperature: deg C.
        settings: Name to value; NaN where the firmware does not know the name.
    """

    answers: bool
    firmware: int = 0
    register_map: int = 0
    serial: str = ""
    home: int = 0
    position: float = math.nan
    mode: int = 0
    fault: int = 0
    voltage: float = math.nan
    temperature: float = math.nan
    settings: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """One check of one drive.

    Attributes:
        joint: 0 for the hip, 1 for the knee.
        check: What was checked, in a word or two.
        found: What was found.
        complaint: Why the drive may not be armed, and what to do; empty if all is well.
        setting: Name of the configuration entry that is wrong, if that is the complaint.
    """

    joint: int
    check: str
    found: str
    complaint: str = ""
    setting: str = ""


def check_drives(robot: Robot, limits: SafetyLimits, drives: Sequence[DriveInfo]) -> list[Finding]:
    """Return all checks of both drives.

    Args:
        robot: What the drives should belong to.
        limits: Where the leg may start, and at which voltage and temperature.
        drives: Hip and knee.
    """
    findings: list[Finding] = []
    for joint, facts in enumerate(drives):
        findings += _of_drive(robot, limits, joint, facts)
    return findings


def require_fit(findings: Sequence[Finding]) -> None:
    """Refuse to arm if anything is wrong.

    Raises:
        HardwareError: The first complaint, and how many more there are.
    """
    complaints = [f.complaint for f in findings if f.complaint]
    if complaints:
        more = f" {len(complaints) - 1} more: see `hop doctor`." if len(complaints) > 1 else ""
        raise HardwareError(f"Not armed: {complaints[0]}{more}")


def _of_drive(robot: Robot, limits: SafetyLimits, joint: int, facts: DriveInfo) -> list[Finding]:
    name, address = JOINTS[joint], joint_transforms(robot)[joint].id
    if not facts.answers:
        complaint = (
            f"the {name}'s drive (id {address}) does not answer; check its power, the CAN cable"
            " and its termination, and hardware.id in the robot's file."
        )
        return [Finding(joint, "answers", "no", complaint)]
    return [
        Finding(joint, "answers", f"id {address}"),
        *_of_identity(robot, joint, facts),
        *_of_power(limits, joint, facts),
        *_of_configuration(robot, joint, facts),
        *_of_pose(limits, joint, facts),
    ]


def _of_identity(robot: Robot, joint: int, facts: DriveInfo) -> list[Finding]:
    name, servo, address = (
        JOINTS[joint],
        robot.hardware.servos[joint],
        joint_transforms(robot)[joint].id,
    )
    serial = (
        f"the drive with id {address} has serial number {facts.serial} but the robot's file"
        f" expects {servo.serial} at the {name}; are two drives swapped?"
    )
    speaks = (
        f"the {name}'s firmware has register map {facts.register_map} but this version speaks"
        f" {REGISTER_MAP}; flash another firmware with `moteus_tool --flash`."
    )
    fault = fault_text(facts.fault) if facts.mode == DriveMode.FAULT else "none"
    broken = (
        f"the {name}'s drive reports {fault}; remove its cause and switch the power off and on."
    )
    version = f"{facts.register_map}, firmware {facts.firmware:#06x}"
    return [
        _finding(joint, "serial number", facts.serial, servo.serial in ("", facts.serial), serial),
        _finding(joint, "register map", version, facts.register_map == REGISTER_MAP, speaks),
        _finding(joint, "fault", fault, fault == "none", broken),
    ]


def _of_power(limits: SafetyLimits, joint: int, facts: DriveInfo) -> list[Finding]:
    name, low, high = JOINTS[joint], limits.voltage_low, limits.voltage_high
    volts, heat = f"{facts.voltage:.1f} V", f"{facts.temperature:.0f} deg C"
    supply = (
        f"the bus voltage at the {name} is {volts} but must lie between {low:g} and {high:g} V;"
        " check the supply."
    )
    hot = f"the {name}'s drive has {heat}; let it cool below {limits.temperature:g}."
    return [
        _finding(joint, "bus voltage", volts, low <= facts.voltage <= high, supply),
        _finding(joint, "temperature", heat, facts.temperature <= limits.temperature, hot),
    ]


def _of_pose(limits: SafetyLimits, joint: int, facts: DriveInfo) -> list[Finding]:
    name, low, high = JOINTS[joint], limits.lower[joint], limits.upper[joint]
    homed = facts.home == HOMED
    lost = (
        f"the {name} is not homed: after power-up its encoder is absolute only within a turn of"
        " its rotor; bring the leg into a pose that you know and run `hop doctor --home`."
    )
    outside = (
        f"the {name} stands at {facts.position:.2f} rad but may only start between {low:.2f} and"
        f" {high:.2f} rad; move it by hand, or home it."
    )
    found = f"{facts.position:.3f} rad"
    return [
        _finding(joint, "homed", "yes" if homed else "no", homed, lost),
        _finding(joint, "position", found, low <= facts.position <= high, outside),
    ]


def _of_configuration(robot: Robot, joint: int, facts: DriveInfo) -> list[Finding]:
    findings = []
    for setting in required_settings(robot, joint):
        found = facts.settings.get(setting.name, float("nan"))
        complaint = (
            ""
            if setting.holds(found)
            else f"the {JOINTS[joint]}'s {setting.name} is {found:.6g} but must be"
            f" {setting.value:.6g} ({setting.why}); let `hop doctor --write` set it."
        )
        wrong = setting.name if complaint else ""
        findings.append(Finding(joint, setting.name, f"{found:.6g}", complaint, wrong))
    return findings


def _finding(joint: int, check: str, found: str, good: bool, complaint: str) -> Finding:
    return Finding(joint, check, found, "" if good else complaint)
