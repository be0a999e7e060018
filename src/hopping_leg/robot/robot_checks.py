"""Whether a robot's numbers fit each other: contradictions are refused, doubts are told."""

import math
from collections.abc import Iterator
from operator import attrgetter

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

_PLAUSIBLE = {
    "base.mass": 50.0,
    **dict.fromkeys(("thigh.mass", "shank.mass"), 50.0),
    **dict.fromkeys(("thigh.length", "shank.length"), 2.0),
    **dict.fromkeys(("hip.motor.rotor_inertia", "knee.motor.rotor_inertia"), 5e-3),
}
"""Largest values, SI, that a leg on a rail may have where they are no mistake of the unit."""

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


def doubts_of_inheritance(chain: list[tuple[str, Tree]], resolved: list[Tree]) -> Iterator[str]:
    """Yield a sentence per file that inherits numbers which belonged to what it changes.

    ``chain`` are the files with their own tables, the root first, ``resolved`` all tables of each.
    """
    for level, (name, own) in enumerate(chain[1:], 1):
        stated_later = {path for _, tree in chain[level + 1 :] for path, _ in numbers(tree)}
        unfit = unfit_numbers(resolved[level - 1], own)
        unfit = {path: cause for path, cause in unfit.items() if path not in stated_later}
        for cause in dict.fromkeys(unfit.values()):
            belong = [path for path in unfit if unfit[path] == cause]
            armature = any(path.endswith(".armature") for path in belong)
            until = " (until then, an armature is what rotor and gear give)" if armature else ""
            yield (
                f"{name} changes {cause} but not {', '.join(belong)}, inherited from"
                f" {chain[level - 1][0]}; state each anew, or as it is with your source{until}."
            )


def doubts_of_values(robot: Robot, stated: Tree, origin: str) -> Iterator[str]:
    """Yield sentences about numbers that look like another unit or are not ``stated``."""
    for path, most in _PLAUSIBLE.items():
        if (value := attrgetter(path)(robot)) > most:
            yield f"{origin}: '{path}' is {value:g} but hardly above {most:g}; is its unit right?"
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        if link.inertia > link.mass * link.length**2:
            yield (
                f"{origin}: '{name}.inertia' exceeds '{name}.mass' times the square of"
                f" '{name}.length' ({link.mass * link.length**2:.3g} kg m2); check all three."
            )
    missing = sorted(_STOPS - {path for path, _ in numbers(stated)})
    if missing and robot.kind == "leg":
        yield f"{origin} does not state {', '.join(missing)}; leg V2's mechanical stops are taken."


def check_physics(robot: Robot, origin: str) -> None:
    """Check that fields do not contradict each other.

    Raises:
        RobotError: Naming the fields that contradict each other.
    """
    for sentence in _contradictions(robot):
        raise RobotError(f"{origin}: {sentence}")


def _contradictions(robot: Robot) -> Iterator[str]:
    joints = (("hip", robot.hip), ("knee", robot.knee))
    for name, joint in joints:
        peak = joint.motor.peak_torque
        if joint.lower >= joint.upper:
            yield (
                f"'{name}.lower' ({joint.lower:g} rad) must lie below '{name}.upper'"
                f" ({joint.upper:g})."
            )
        for key, inner, outer in (
            ("lower", joint.stop_lower, joint.lower),
            ("upper", joint.upper, joint.stop_upper),
        ):
            if inner > outer:
                yield (
                    f"'{name}.{key}' ({getattr(joint, key):g} rad) lies beyond the mechanical stop"
                    f" '{name}.stop_{key}' ({getattr(joint, f'stop_{key}'):g}); state both."
                )
        for smaller in ("torque_limit", "rated_torque"):
            limit = getattr(joint.motor, smaller)
            yield from _above(
                f"{name}.motor.{smaller}", limit, f"{name}.motor.peak_torque", peak, "N m"
            )
        servo, ratio = getattr(robot.hardware, name), joint.motor.gear_ratio
        current, voltage = f"'hardware.{name}.max_current'", "'hardware.voltage_high'"
        constant = f"'hardware.{name}.torque_constant' ({servo.torque_constant:g} N m/A)"
        most = servo.torque_constant * servo.max_current * ratio
        if peak > most * _ROUNDING:
            yield (
                f"'{name}.motor.peak_torque' is {peak:g} N m but {constant} times {current}"
                f" ({servo.max_current:g} A) and the gear ratio gives {most:.3g} N m at most."
            )
        fastest = speed_constant(servo) * robot.hardware.voltage_high / ratio
        if joint.motor.no_load_speed > fastest * _ROUNDING:
            yield (
                f"'{name}.motor.no_load_speed' is {joint.motor.no_load_speed:g} rad/s but by"
                f" {constant} {voltage} ({robot.hardware.voltage_high:g} V) turns it at"
                f" {fastest:.3g} rad/s at most."
            )
        if joint.load_friction >= 1:
            yield (
                f"'{name}.load_friction' is {joint.load_friction:g} but a gear that takes all that"
                " it gets never turns; give less than 1."
            )
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        yield from _above(f"{name}.com", link.com, f"{name}.length", link.length, "m")
    for name in _STOPS if robot.kind == "leg" else ():
        if abs(stop := attrgetter(name)(robot)) > 2 * math.pi:
            yield f"'{name}' is {stop:g} rad but no leg's joint turns more than once, 6.28 rad."
    if robot.kind not in KINDS:
        yield f"'kind': {unknown_name('kind of robot', robot.kind, KINDS)}"
    if robot.kind == "leg" and (robot.knee.lower < -math.pi or robot.knee.upper > 0):
        yield (
            "'knee.lower' and 'knee.upper' must lie between -pi and 0 rad, because a leg's knee"
            " bends to the negative side; for a robot that only swings write kind = 'pendulum'."
        )
    reality = robot.reality
    for (name, joint), drive in zip(joints, (reality.hip, reality.knee), strict=True):
        if drive.efficiency > 1:
            yield (
                f"'reality.{name}.efficiency' is {drive.efficiency:g} but no gear gives more than"
                " it gets; give at most 1."
            )
        if drive.stiction < 1:
            yield (
                f"'reality.{name}.stiction' is {drive.stiction:g} but friction at rest is not below"
                " Coulomb friction; give 1 or more."
            )
        if drive.torque_limit is not None:
            peak = joint.motor.peak_torque * joint.belt_ratio
            high = f"{name}.motor.peak_torque x belt_ratio"
            yield from _above(f"reality.{name}.torque_limit", drive.torque_limit, high, peak, "N m")
    least, ground = 2 * TIMESTEP, reality.ground.time_constant
    for name, softest in (("reality.ground", ground), ("contact", robot.contact.time_constant)):
        if softest is not None and softest < least:
            yield (
                f"'{name}.time_constant' is {softest:g} s but must be at least {least:g} s, two"
                " physics steps; MuJoCo would silently take that instead."
            )
    yield from contradictions(robot.hardware)


def _above(low_name: str, low: float, high_name: str, high: float, unit: str) -> Iterator[str]:
    if low > high:
        yield f"'{low_name}' ({low:g} {unit}) must not exceed '{high_name}' ({high:g})."
