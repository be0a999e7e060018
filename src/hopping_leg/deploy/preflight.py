"""Whether the drives may be armed: every check with a sentence that says why not.

Among the checks is each drive's own configuration, which must be as the robot's file asks. Names
of settings are those of the firmware's ``conf get`` and ``conf set``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from hopping_leg.deploy import drive_link, stop_reasons
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.errors import HardwareError
from hopping_leg.robot import JOINTS, REGISTER_MAP, Robot


@dataclass(frozen=True)
class Setting:
    """One entry of a drive's configuration as wanted, and what depends on it."""

    name: str
    value: float
    why: str

    def holds(self, found: float) -> bool:
        """Tell whether a drive's value is the wanted one, within the rounding of its text."""
        return math.isclose(found, self.value, rel_tol=1e-3, abs_tol=1e-6)

    @property
    def text(self) -> str:
        """The value as ``conf set`` takes it."""
        return f"{self.value:.9g}"


def required_settings(robot: Robot, joint: int) -> tuple[Setting, ...]:
    """Return the configuration of one joint's drive: 0 for the hip, 1 for the knee."""
    servo, transform = robot.hardware.servos[joint], drive_link.joint_transforms(robot)[joint]
    axis = (robot.hip, robot.knee)[joint]
    stops = (axis.stop_lower, axis.stop_upper)
    ends = sorted(transform.motor_position(angle) for angle in stops)
    return (
        Setting("motor_position.rotor_to_output_ratio", 1 / axis.motor.gear_ratio, "gear ratio"),
        Setting("servopos.position_min", ends[0], "mechanical stop"),
        Setting("servopos.position_max", ends[1], "mechanical stop"),
        Setting("servo.max_current_A", servo.max_current, "motor current"),
        # The firmware's default is limp.
        Setting(
            "servo.timeout_mode", int(drive_link.DriveMode.BRAKE), "brakes when the host is silent"
        ),
        Setting("servo.default_timeout_s", robot.hardware.watchdog, "watchdog"),
    )


_HOMED = 2  # Home state of a drive that knows where its output is (register 0x00c)


@dataclass(frozen=True)
class DriveInfo:
    """One drive before arming, at the joint, SI; of one that does not answer nothing is known.

    Versions are as its registers hold them, its controller's serial number has 24 hex digits. Home
    is 2 where it has been told where its output is, the position is what it believes. Settings are
    NaN where the firmware does not know their names.
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
    """One check of one drive: joint 0 is the hip, 1 the knee.

    A complaint says why the drive may not be armed, and what to do; empty if all is well. The
    setting is the configuration entry that is wrong, if that is the complaint.
    """

    joint: int
    check: str
    found: str
    complaint: str = ""
    setting: str = ""


def check_drives(robot: Robot, limits: SafetyLimits, drives: Sequence[DriveInfo]) -> list[Finding]:
    """Return all checks of both drives, hip and knee; ``limits`` say where the leg may start."""
    return [f for joint, facts in enumerate(drives) for f in _check(robot, limits, joint, facts)]


def require_fit(findings: Sequence[Finding]) -> None:
    """Refuse to arm by a HardwareError: the first complaint, and how many more there are."""
    complaints = [f.complaint for f in findings if f.complaint]
    if complaints:
        more = f" {len(complaints) - 1} more: see `hop doctor`." if len(complaints) > 1 else ""
        raise HardwareError(f"Not armed: {complaints[0]}{more}")


def _check(robot: Robot, limits: SafetyLimits, joint: int, facts: DriveInfo) -> list[Finding]:
    name, address = JOINTS[joint], drive_link.joint_transforms(robot)[joint].id

    def finding(check: str, found: str, good: bool, complaint: str, setting: str = "") -> Finding:
        return Finding(joint, check, found, *(("", "") if good else (complaint, setting)))

    answers = finding(
        "answers",
        f"id {address}" if facts.answers else "no",
        facts.answers,
        f"the {name}'s drive (id {address}) does not answer; check its power, the CAN cable"
        " and its termination, and hardware.id in the robot's file.",
    )
    if not facts.answers:
        return [answers]
    serial, fault = robot.hardware.servos[joint].serial, "none"
    if facts.mode == drive_link.DriveMode.FAULT:
        fault = stop_reasons.fault_text(facts.fault)
    voltage_low, voltage_high = limits.voltage_low, limits.voltage_high
    lower, upper = limits.start[joint]
    return [
        answers,
        finding(
            "serial number",
            facts.serial,
            serial in ("", facts.serial),
            f"the drive with id {address} has serial number {facts.serial} but the robot's file"
            f" expects {serial} at the {name}; are two drives swapped?",
        ),
        finding(
            "register map",
            f"{facts.register_map}, firmware {facts.firmware:#06x}",
            facts.register_map == REGISTER_MAP,
            f"the {name}'s firmware has register map {facts.register_map} but this version speaks"
            f" {REGISTER_MAP}; flash another firmware with `moteus_tool --flash`.",
        ),
        finding(
            "fault",
            fault,
            fault == "none",
            f"the {name}'s drive reports {fault}; remove its cause and switch the power off and"
            " on.",
        ),
        finding(
            "bus voltage",
            f"{facts.voltage:.1f} V",
            voltage_low <= facts.voltage <= voltage_high,
            f"the bus voltage at the {name} is {facts.voltage:.1f} V but must lie between"
            f" {voltage_low:g} and {voltage_high:g} V; check the supply.",
        ),
        finding(
            "temperature",
            f"{facts.temperature:.0f} deg C",
            facts.temperature <= limits.temperature,
            f"the {name}'s drive has {facts.temperature:.0f} deg C; let it cool below"
            f" {limits.temperature:g}.",
        ),
        *(
            finding(
                setting.name,
                f"{found:.6g}",
                setting.holds(found),
                f"the {name}'s {setting.name} is {found:.6g} but must be {setting.value:.6g}"
                f" ({setting.why}); `hop doctor` sets it with --write.",
                setting.name,
            )
            for setting in required_settings(robot, joint)
            for found in [facts.settings.get(setting.name, math.nan)]
        ),
        finding(
            "homed",
            "yes" if facts.home == _HOMED else "no",
            facts.home == _HOMED,
            f"the {name} is not homed: after power-up its encoder is absolute only within a turn"
            " of its rotor; bring the leg into a pose that you know and tell"
            " `hop doctor` it with --home.",
        ),
        finding(
            "position",
            f"{facts.position:.3f} rad",
            lower <= facts.position <= upper,
            f"the {name} stands at {facts.position:.3f} rad but may only start between"
            f" {lower:.3f} and {upper:.3f} rad; move it by hand, or home it.",
        ),
    ]
