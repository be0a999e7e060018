"""Whether a robot's numbers fit each other: contradictions are refused, doubts are told."""

import math
from collections.abc import Iterator
from operator import attrgetter

import numpy as np

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import Tree
from hopping_leg.robot.hardware import contradictions, speed_constant
from hopping_leg.robot.model import TIMESTEP
from hopping_leg.robot.parameters import JOINTS, KINDS, Robot

_REACH = [f"{joint}.{end}" for joint in JOINTS for end in ("lower", "upper")]
_REACH += ["knee.stop_lower", "knee.stop_upper"]  # where the folded foot meets the hip's housing
_AT_OUTPUT = ("torque_limit", "peak_torque", "rated_torque", "no_load_speed")

_DEPENDENTS: dict[str, list[str]] = {}
"""Numbers that belong to another's value, by that other's path in a robot file."""
for _link in ("thigh", "shank"):
    _DEPENDENTS[f"{_link}.mass"] = [f"{_link}.com", f"{_link}.inertia"]
    _DEPENDENTS[f"{_link}.length"] = [*_DEPENDENTS[f"{_link}.mass"], *_REACH]
for _joint in JOINTS:
    _armature, _losses = f"{_joint}.armature", [f"{_joint}.friction", f"{_joint}.damping"]
    _DEPENDENTS[f"{_joint}.motor.rotor_inertia"] = [_armature]
    _DEPENDENTS[f"{_joint}.belt_ratio"] = [_armature, *_losses]
    _at_output = [f"{_joint}.motor.{name}" for name in _AT_OUTPUT]
    _DEPENDENTS[f"{_joint}.motor.gear_ratio"] = [_armature, *_losses, *_at_output]

PLAUSIBLE: dict[str, tuple[float, float]] = {
    "mass": (5e-3, 20.0),
    "length": (0.03, 1.0),
    "com": (5e-4, 1.0),
    "radius": (1e-3, 0.2),
    "friction": (0.0, 20.0),
    "rotor_inertia": (1e-7, 5e-3),
    "armature": (1e-6, 0.5),
    "gear_ratio": (1.0, 200.0),
    "belt_ratio": (1.0, 10.0),
    "peak_torque": (0.1, 300.0),
    "torque_limit": (0.05, 300.0),
    "rated_torque": (0.05, 300.0),
    "no_load_speed": (2.0, 200.0),
    "time_constant": (0.0, 0.5),
    "damping_ratio": (0.05, 20.0),
}
"""Least and largest values, SI, that a leg on a rail may have, by the last part of the path."""
_WIDEST = {"leg": 2 * math.pi, "pendulum": 12 * math.pi}
"""Largest joint limits, rad, by the robot's kind."""
_INERTIAS = (2e-3, 1.0)
"""Inertia of a link over its mass and the square of its length."""
_ROUNDING = 1.001
_STOPS = {f"{joint}.stop_{end}" for joint in JOINTS for end in ("lower", "upper")}


def numbers(tree: Tree, prefix: str = "") -> list[tuple[str, Tree]]:
    """Return (path, entry) of every number in a robot's tables, in the file's order."""
    found: list[tuple[str, Tree]] = []
    for key, value in tree.items():
        if isinstance(value, dict):
            path = f"{prefix}{key}"
            found += [(path, value)] if "value" in value else numbers(value, f"{path}.")
    return found


def unfit_numbers(parent: Tree, child: Tree) -> dict[str, str]:
    """Return inherited numbers that belong to a value which the child changes: to that path."""
    inherited, own = ({p: e["value"] for p, e in numbers(t)} for t in (parent, child))
    return {
        dependent: path
        for path, value in own.items()
        if value != inherited.get(path, value)
        for dependent in _DEPENDENTS.get(path, ())
        if dependent in inherited and dependent not in own
    }


def doubts_of_inheritance(name: str, own: Tree, origin: str, inherited: Tree) -> Iterator[str]:
    """Yield a sentence per number of a file ``name`` to which inherited ones belonged.

    ``own`` are the file's tables, ``inherited`` all those of ``origin``, which it extends.
    """
    unfit = unfit_numbers(inherited, own)
    for cause in dict.fromkeys(unfit.values()):
        belong = ", ".join(path for path in unfit if unfit[path] == cause)
        yield (
            f"{name} changes {cause} but not {belong}, inherited from {origin}; state each anew, or"
            " as it is with your source (an armature that is not stated is what rotor and gear"
            " give)."
        )


def doubts_of_values(robot: Robot, stated: Tree, origin: str) -> Iterator[str]:
    """Yield sentences about ``stated`` numbers of a robot that are hardly right."""
    widest = _WIDEST[robot.kind]
    plausible = {**PLAUSIBLE, "lower": (-widest, widest), "upper": (-widest, widest)}
    for path, entry in numbers(stated):
        low, high = plausible.get(path.rpartition(".")[2], (-math.inf, math.inf))
        if not path.startswith("reality."):
            yield from _beyond(origin, path, entry["value"], low, high, entry["unit"])
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        low, high = (share * link.mass * link.reach**2 for share in _INERTIAS)
        yield from _beyond(origin, f"{name}.inertia", link.inertia, low, high, "kg m2")
    if robot.kind == "leg" and not _stands(robot):
        yield (
            f"{origin}: within 'hip.lower' to 'knee.upper' the foot never comes below the hip; is a"
            " joint's sign wrong, or does the knee bend forward?"
        )


def _beyond(
    origin: str, path: str, value: float, low: float, high: float, unit: str
) -> Iterator[str]:
    if not low <= value <= high:
        yield (
            f"{origin}: '{path}' is {value:.5g} {unit} but hardly beyond {low:.3g} to {high:.3g}"
            f" {unit}; check its unit and decimal point."
        )


def _stands(robot: Robot) -> bool:
    """Tell whether some posture within the soft limits has the foot straight below the hip."""
    knee = np.linspace(robot.knee.lower, robot.knee.upper, 50)
    thigh, shank = robot.thigh.length, robot.shank.length
    hip = np.arctan2(-shank * np.sin(knee), thigh + shank * np.cos(knee))
    return bool(np.any((robot.hip.lower <= hip) & (hip <= robot.hip.upper)))


def check_physics(robot: Robot, origin: str) -> None:
    """Check that fields do not contradict each other.

    Raises:
        RobotError: Naming the fields that contradict each other.
    """
    for sentence in _contradictions(robot):
        raise RobotError(f"{origin}: {sentence}")


def _contradictions(robot: Robot) -> Iterator[str]:
    if robot.kind not in KINDS:
        yield f"'kind': {unknown_name('kind of robot', robot.kind, KINDS)}"
    for name in JOINTS:
        yield from _joint_contradictions(robot, name)
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        end = f"{name}.{'extent' if link.extent else 'length'}"
        yield from _above(f"{name}.com", link.com, end, link.reach, "m")
    if robot.kind == "leg":
        for name in _STOPS:
            if abs(stop := attrgetter(name)(robot)) > 2 * math.pi:
                yield f"'{name}' is {stop:g} rad but no leg's joint turns more than once, 6.28 rad."
        if robot.knee.lower < -math.pi or robot.knee.upper > 0:
            yield (
                "'knee.lower' and 'knee.upper' must lie between -pi and 0 rad, because a leg's knee"
                " bends to the negative side; for a robot that only swings write kind = 'pendulum'."
            )
    least = 2 * TIMESTEP
    why = "two physics steps; MuJoCo would take that instead"
    for name, softest in (
        ("reality.ground", robot.reality.ground.time_constant),
        ("contact", robot.contact.time_constant),
    ):
        if softest is not None and softest < least:
            yield f"'{name}.time_constant' is {softest:g} s; give at least {least:g} s, {why}."
    yield from contradictions(robot.hardware)


def _joint_contradictions(robot: Robot, name: str) -> Iterator[str]:
    joint, servo = attrgetter(name)(robot), getattr(robot.hardware, name)
    drive, motor = getattr(robot.reality, name), joint.motor
    if joint.lower >= joint.upper:
        high = f"'{name}.upper' ({joint.upper:g})"
        yield f"'{name}.lower' ({joint.lower:g} rad) must lie below {high}."
    for key, inner, outer in (
        ("lower", joint.stop_lower, joint.lower),
        ("upper", joint.upper, joint.stop_upper),
    ):
        if inner > outer:
            yield (
                f"'{name}.{key}' ({getattr(joint, key):g} rad) lies beyond the mechanical stop"
                f" '{name}.stop_{key}' ({getattr(joint, f'stop_{key}'):g}); is it in degrees?"
            )
    peak, at = motor.peak_torque, f"{name}.motor"
    for smaller in ("torque_limit", "rated_torque"):
        yield from _above(
            f"{at}.{smaller}", getattr(motor, smaller), f"{at}.peak_torque", peak, "N m"
        )
    if drive.torque_limit is not None:
        high = f"{at}.peak_torque x belt_ratio"
        limit, most = drive.torque_limit, peak * joint.belt_ratio
        yield from _above(f"reality.{name}.torque_limit", limit, high, most, "N m")
    constant = f"'hardware.{name}.torque_constant' ({servo.torque_constant:g} N m/A)"
    most = servo.torque_constant * servo.max_current * motor.gear_ratio
    if peak > most * _ROUNDING:
        yield (
            f"'{at}.peak_torque' is {peak:g} N m but {constant} times 'hardware.{name}.max_current'"
            f" ({servo.max_current:g} A) and '{at}.gear_ratio' ({motor.gear_ratio:g}) gives"
            f" {most:.3g} N m at most."
        )
    fastest = speed_constant(servo) * robot.hardware.voltage_high / motor.gear_ratio
    if motor.no_load_speed > fastest * _ROUNDING:
        yield (
            f"'{at}.no_load_speed' is {motor.no_load_speed:g} rad/s but by {constant}"
            f" 'hardware.voltage_high' ({robot.hardware.voltage_high:g} V) turns it at"
            f" {fastest:.3g} rad/s at most."
        )
    for path, wrong, why in (
        (f"{name}.load_friction", joint.load_friction >= 1, "less than 1, or the gear never turns"),
        (f"reality.{name}.efficiency", drive.efficiency > 1, "at most 1, as of any gear"),
        (f"reality.{name}.stiction", drive.stiction < 1, "1 or more, times Coulomb friction"),
    ):
        if wrong:
            yield f"'{path}' is {attrgetter(path)(robot):g}; give {why}."


def _above(low_name: str, low: float, high_name: str, high: float, unit: str) -> Iterator[str]:
    if low > high:
        yield f"'{low_name}' ({low:g} {unit}) must not exceed '{high_name}' ({high:g})."
