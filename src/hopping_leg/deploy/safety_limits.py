"""Within what the leg may move; beyond it the supervisor damps."""

from dataclasses import dataclass, replace

from hopping_leg.deploy.drive_link import Pair
from hopping_leg.deploy.plausibility import MotorLine
from hopping_leg.robot import OVERSPEED, Joint, Robot, braking_times

RECORDING_MARGIN = 0.1
"""How far a recorded leg may pass its mechanical range, rad: backlash and the belt's give."""

START_MARGIN = 0.5
"""How far beyond its soft limits a joint may stand before it hops, rad; farther, it is bent to the
wrong side, or homed wrongly."""


@dataclass(frozen=True)
class SafetyLimits:
    """Limits of one run; pairs are (hip, knee) at the joint."""

    lower: Pair
    """rad"""
    upper: Pair
    """rad"""
    start: tuple[Pair, Pair]
    """Between which angles hip and knee may stand when the drives are armed, rad."""
    braking: Pair
    """How long before these angles a joint at its present speed must be braked, s."""
    torque: Pair
    """Largest torque that leaves, N m."""
    speed: Pair
    """rad/s"""
    motors: tuple[MotorLine, MotorLine]
    """What hip's and knee's motors can give."""
    voltage_low: float
    """V"""
    voltage_high: float
    """V"""
    temperature: float
    """deg C"""
    period: float = 0.005
    """Control period, s."""
    excess_torque: float = 1.5
    """Measured torque over ``torque`` that is too much."""
    excess_ticks: int = 4
    """Ticks in a row with too much torque that are tolerated: one sample may be noise."""
    jump: float = 0.15
    """Error of a position predicted from the last one and the velocities, rad per period."""
    drift: float = 0.2
    """What a position may gain over the integral of its velocity within about a second, rad;
    light legs show 0.1 at impacts."""
    clock: float = 0.005
    """What a drive's clock may gain on this computer's beyond what quartzes do, s."""
    missing_ticks: int = 3
    """Ticks in a row without a reply that are tolerated: as many as the drives' watchdog lets the
    host miss."""
    overrun_ticks: int = 4
    """Ticks that begin more than a period late and are tolerated, see ``Counts.overruns``."""
    stall: float = 0.02
    """Lateness of a single tick beyond which the loop stood still, s."""
    arming_time: float = 0.5
    """Time for the drives to begin to follow torques, s."""
    damping_least: float = 0.3
    """Least time of braking, s."""
    damping_most: float = 2.0
    """Longest time of braking, s."""
    rest_speed: float = 0.2
    """Joint speed that counts as rest, rad/s."""


def hopping_limits(robot: Robot, rate: float) -> SafetyLimits:
    """Return the limits for a hopping leg at a rate, Hz: it can be braked before any stop."""
    limits = _limits(robot, rate, 0.0, braking_times(robot, rate).tolist())
    hip, knee = (
        (max(j.lower - START_MARGIN, j.stop_lower), min(j.upper + START_MARGIN, j.stop_upper))
        for j in (robot.hip, robot.knee)
    )
    return replace(limits, start=(hip, knee))


def recording_limits(robot: Robot, rate: float) -> SafetyLimits:
    """Return the limits for excitations at a rate, Hz: the whole mechanical range and a margin.

    How fast a joint nears a stop does not count: an excitation turns round by itself.
    """
    return _limits(robot, rate, RECORDING_MARGIN, (0.0, 0.0))


def _limits(robot: Robot, rate: float, margin: float, braking: Pair) -> SafetyLimits:
    hip, knee, hardware = robot.hip, robot.knee, robot.hardware
    lower = hip.stop_lower - margin, knee.stop_lower - margin
    upper = hip.stop_upper + margin, knee.stop_upper + margin
    return SafetyLimits(
        lower,
        upper,
        start=((lower[0], upper[0]), (lower[1], upper[1])),
        braking=(braking[0], braking[1]),
        torque=(hip.torque_limit, knee.torque_limit),
        speed=(OVERSPEED * hip.no_load_speed, OVERSPEED * knee.no_load_speed),
        motors=(_line(hip), _line(knee)),
        voltage_low=hardware.voltage_low,
        voltage_high=hardware.voltage_high,
        temperature=hardware.temperature_limit,
        period=1 / rate,
        stall=max(hardware.watchdog, 1 / rate),
    )


def _line(joint: Joint) -> MotorLine:
    stall = joint.motor.peak_torque * joint.belt_ratio
    return MotorLine(joint.torque_limit, stall, joint.no_load_speed, joint.friction)
