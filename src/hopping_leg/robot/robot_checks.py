"""Whether a robot's numbers fit each other: contradictions are refused, doubts are told."""

import math
from collections.abc import Iterator
from operator import attrgetter

import numpy as np

from hopping_leg.errors import RobotError
from hopping_leg.io import Tree
from hopping_leg.robot.hardware import torque_constant
from hopping_leg.robot.model import GRAVITY, TIMESTEP
from hopping_leg.robot.parameters import JOINTS, Robot

Bounds = tuple[str, float, float, str]
"""A number's path in a robot file, its least and largest value, and what says so."""

_DRIVES: tuple[Bounds, ...] = (
    ("hardware.watchdog", 0.002, 0.1, "the drives' default is 0.1 s (servo.default_timeout_s)"),
    ("hardware.temperature_limit", 20.0, 75.0, "drives trip at 75 deg C (servo.fault_temperature)"),
    ("hardware.voltage_high", 10.0, 46.0, "moteus drives trip at 46 V (servo.max_voltage)"),
)
"""Bounds that no robot file can move: beyond them a limit guards nothing."""
_ROUNDING = 1.001
_STANDING = 0.5  # share of the knee's torque limit that standing may take of a leg that hops

_AT_OUTPUT = ("torque_limit", "peak_torque", "rated_torque", "no_load_speed")
_DEPENDENTS: dict[str, list[str]] = {}
"""Numbers that belong to another's value, by that other's path in a robot file."""
for _link in ("thigh", "shank"):
    for _key in ("mass", "length"):
        _DEPENDENTS[f"{_link}.{_key}"] = [f"{_link}.com", f"{_link}.inertia"]
for _joint in JOINTS:
    for _key in ("motor.rotor_inertia", "belt_ratio", "motor.gear_ratio"):
        _DEPENDENTS[f"{_joint}.{_key}"] = [f"{_joint}.armature"]
    _DEPENDENTS[f"{_joint}.motor.gear_ratio"] += [f"{_joint}.motor.{key}" for key in _AT_OUTPUT]


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


def find_doubts(robot: Robot, origin: str, own: Tree, parent: str, inherited: Tree) -> list[str]:
    """Return sentences about numbers that are hardly right or do not fit each other.

    ``own`` are the tables of the robot's file, ``inherited`` those of ``parent``, which it extends.
    """
    unfit = unfit_numbers(inherited, own)
    found = [
        f"{origin} changes {cause} but not {', '.join(p for p in unfit if unfit[p] == cause)},"
        f" inherited from {parent}; state each anew, or as it is with your source (an armature that"
        " is not stated is what rotor and gear give)."
        for cause in dict.fromkeys(unfit.values())
    ]
    unusual: dict[str, str] = {}  # by part: one number that is wrong makes others look so
    for path, low, high in _usual(robot):
        if not low <= (value := attrgetter(path)(robot)) <= high:
            said = f"{origin}: '{path}' is {value:.5g}, which hardly fits the other numbers"
            said += f" ({low:.3g} to {high:.3g}); check their units and decimal points."
            unusual.setdefault(path.partition(".")[0], said)
    if robot.kind == "leg" and not unusual:
        found += (f"{origin}: {doubt}" for doubt in _doubtful_stance(robot))
    return [*unusual.values(), *found]


def _usual(robot: Robot) -> Iterator[tuple[str, float, float]]:
    """Yield paths with the least and largest value that fits the leg's other numbers."""
    size = robot.thigh.length + robot.shank.length
    swinging = robot.thigh.mass + robot.shank.mass
    yield "base.mass", 0, 100 * swinging
    for ball in ("base", "knee_cap", "foot"):
        yield f"{ball}.radius", 0, size
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        whole = link.mass * link.reach**2
        yield f"{name}.length", 0.01, 3.0
        yield f"{name}.mass", 0, 10 * (robot.mass - link.mass)
        yield f"{name}.inertia", 0.002 * whole, whole
    for name, joint in (("hip", robot.hip), ("knee", robot.knee)):
        most, gear = robot.mass * size**2, (joint.motor.gear_ratio * joint.belt_ratio) ** 2
        yield f"{name}.friction", 0, joint.torque_limit / 2
        yield f"{name}.damping", 0, joint.torque_limit / math.sqrt(GRAVITY / size)
        yield f"{name}.motor.rotor_inertia", 0, most / gear
        yield f"{name}.armature", 0, most


def _doubtful_stance(robot: Robot) -> Iterator[str]:
    """Yield what is odd of the postures within the soft limits with the foot below the hip."""
    knee = np.linspace(robot.knee.lower, robot.knee.upper, 51)
    thigh, shank = robot.thigh.length, robot.shank.length
    hip = np.arctan2(-shank * np.sin(knee), thigh + shank * np.cos(knee))
    if not np.any((robot.hip.lower <= hip) & (hip <= robot.hip.upper)):
        never = "within 'hip.lower' to 'knee.upper' the foot never comes below the hip; "
        yield never + "is a joint's sign wrong, or does the knee bend forward?"
    torque, limit = robot.mass * GRAVITY * thigh * abs(np.sin(hip[25])), robot.knee.torque_limit
    if torque > _STANDING * limit:
        yield (
            f"standing with the knee at {knee[25]:.3g} rad takes {torque:.3g} N m of it, and its"
            f" torque limit is {limit:.3g} N m: too little to hop; check masses and motor."
        )


def check_physics(robot: Robot, origin: str) -> None:
    """Refuse fields that contradict each other, by a RobotError that names them."""
    hip, knee = robot.hardware.servos
    for path, low, high, why in _bounds(robot):
        value = attrgetter(path)(robot)
        if value is not None and not low <= value <= high:
            within = f"lie between {low:.5g} and {high:.5g}"
            lie = within if high < math.inf else f"be {low:.5g} or more"
            raise RobotError(f"{origin}: '{path}' is {value:g} but must {lie}: {why}.")
    for name, servo in zip(JOINTS, robot.hardware.servos, strict=True):
        if servo.id % 1 or abs(servo.sign) != 1:
            at = f"{origin}: 'hardware.{name}"
            raise RobotError(f"{at}.id' must be a whole number, and its 'sign' 1 or -1.")
    if hip.id == knee.id:
        raise RobotError(f"{origin}: 'hardware.hip.id' and 'hardware.knee.id' are both {hip.id:g}.")


def _bounds(robot: Robot) -> Iterator[Bounds]:
    """Yield what other numbers leave of each."""
    volts, slack = robot.hardware.voltage_high, 1e-6
    yield from _DRIVES
    why = "moteus drives work from 10 V, and it is less than 'hardware.voltage_high'"
    yield "hardware.voltage_low", 10.0, volts - slack, why
    for name, servo in zip(JOINTS, robot.hardware.servos, strict=True):
        joint, at, by = attrgetter(name)(robot), f"{name}.motor", f"'hardware.{name}."
        motor, reach = joint.motor, math.inf if robot.kind == "pendulum" else 2 * math.pi
        for end in ("stop_lower", "stop_upper"):
            yield f"{name}.{end}", -reach, reach, "no leg's joint turns more than once"
        why = f"'{name}.stop_lower', the mechanical stop, and '{name}.upper' (in degrees?)"
        yield f"{name}.lower", joint.stop_lower, joint.upper - slack, why
        why = f"'{name}.lower' and '{name}.stop_upper', the mechanical stop (in degrees?)"
        yield f"{name}.upper", joint.lower, joint.stop_upper, why
        for key in ("torque_limit", "rated_torque"):
            yield f"{at}.{key}", 0, motor.peak_torque, f"'{at}.peak_torque'"
        most = motor.peak_torque * joint.belt_ratio
        yield f"reality.{name}.torque_limit", 0, most, f"'{at}.peak_torque' times the belt ratio"
        most = _ROUNDING * servo.torque_constant * servo.max_current * motor.gear_ratio
        yield f"{at}.peak_torque", 0, most, f"{by}torque_constant' times 'max_current' and the gear"
        most = _ROUNDING * torque_constant(servo.torque_constant) * volts / motor.gear_ratio
        yield f"{at}.no_load_speed", 0, most, f"'hardware.voltage_high' by {by}torque_constant'"
        yield f"{name}.load_friction", 0, 1 - slack, "or the gear never turns"
        yield f"reality.{name}.efficiency", 0, 1, "as of any gear"
        yield f"reality.{name}.stiction", 1, math.inf, "times Coulomb friction"
        yield f"hardware.{name}.id", 1, 126, "a CAN id of moteus"
        yield f"hardware.{name}.max_current", 0, 100.0, "a moteus r4 gives 100 A at most"
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        yield f"{name}.com", 0, link.reach, f"'{name}.{'extent' if link.extent else 'length'}'"
    if robot.kind == "leg":
        why = "a leg's knee bends to the negative side; what only swings has kind = 'pendulum'"
        yield "knee.lower", -math.pi, 0, why
        yield "knee.upper", -math.pi, 0, why
    for at in ("reality.ground", "contact"):
        why = "two physics steps; MuJoCo would take that instead"
        yield f"{at}.time_constant", 2 * TIMESTEP, math.inf, why
