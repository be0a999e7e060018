"""Whether a robot's numbers fit each other: contradictions are refused, doubts are told."""

import math
from collections.abc import Iterator
from operator import attrgetter

import numpy as np

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import Tree
from hopping_leg.robot.hardware import contradictions, speed_constant
from hopping_leg.robot.model import GRAVITY, TIMESTEP
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
_SLIPS = {
    "kg": {1e-3: "g", 0.45359: "lb"},
    "m": {1e-3: "mm", 1e-2: "cm", 0.0254: "inches"},
    "kg m2": {1e-9: "g mm2 or kg um2", 1e-7: "g cm2", 1e-6: "kg mm2", 1e-4: "kg cm2"},
    "N m": {1e-3: "mN m", 1e-2: "N cm", 0.0980665: "kgf cm"},
    "rad/s": {math.pi / 30: "rpm", math.pi / 180: "degrees/s", 2 * math.pi: "turns/s"},
    "rad": {math.pi / 180: "degrees", 2 * math.pi: "turns"},
    "s": {1e-3: "ms", 1e-6: "us"},
    "1": {},
}
"""What one of another unit is, SI."""
_WIDEST = {"leg": 2 * math.pi, "pendulum": 12 * math.pi}
"""Largest joint limits, rad, by the robot's kind."""
_HEAVIEST = 40.0  # kg, of a link per metre
_CROSSWAYS = 1.2  # share of an inertia that the width of a link and its motor may add
_LEAST_GYRATION = 0.05  # radius of gyration over length that a link hardly falls below
_ARMATURES = (5e-3, 20.0)  # armature over what rotor, gear and belt reflect
_SIZES = ("mass", "length", "com", "inertia", "radius", "ratio", "_torque", "_limit", "_speed")
"""Ends of the paths of numbers that one robot hardly has ten times of another's."""
_EXACTLY = 0.01  # of a power of ten, within which a changed number has lost its decimal point

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
        before = {path: entry["value"] for path, entry in numbers(resolved[level - 1])}
        for path, entry in numbers(own):
            value, was = entry["value"], before.get(path, 0.0)
            power = math.log10(value / was) if value * was > 0 else 0.0
            if path.endswith(_SIZES) and round(power) and abs(power - round(power)) < _EXACTLY:
                yield (
                    f"{name}: '{path}' is {value:g} {entry['unit']}, {10.0 ** round(power):g} times"
                    f" that of {chain[level - 1][0]}; is its decimal point right?"
                )
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
    for path, entry in numbers(stated):
        name = path.rpartition(".")[2]
        low, high = PLAUSIBLE.get(name, (-math.inf, math.inf))
        if name in ("lower", "upper", "stop_lower", "stop_upper"):
            low, high = -_WIDEST[robot.kind], _WIDEST[robot.kind]
        if path.startswith("reality.") or low <= entry["value"] <= high:
            continue
        guess = _slip(entry["value"], entry["unit"], low, high)
        yield (
            f"{origin}: '{path}' is {entry['value']:g} {entry['unit']} but hardly beyond {low:g} to"
            f" {high:g}; {guess}?"
        )
    balls = (robot.base.radius, robot.knee_cap.radius, robot.foot.radius)
    links = (("thigh", robot.thigh), ("shank", robot.shank))
    for (name, link), above, below in zip(links, balls, balls[1:], strict=False):
        # the farther apart the two ends at which all mass sits, the larger is the inertia
        reach = link.reach + below - link.com
        most = _CROSSWAYS * link.mass * (link.com + above) * reach
        least = link.mass * (_LEAST_GYRATION * link.length) ** 2
        if least < most and not least <= link.inertia <= most:
            radius = math.sqrt(link.inertia / link.mass)
            yield (
                f"{origin}: '{name}.inertia' is {link.inertia:g} kg m2, a radius of gyration of"
                f" {radius:.3g} m on a link of {link.length:g} m, whose mass and centre of mass"
                f" allow {least:.2g} to {most:.2g} kg m2;"
                f" {_slip(link.inertia, 'kg m2', least, most)}? State '{name}.extent' where a"
                " weight sticks out."
            )
        if link.mass > _HEAVIEST * link.length:
            yield (
                f"{origin}: '{name}.mass' is {link.mass:g} kg on {link.length:g} m; "
                f"{_slip(link.mass, 'kg', 0.0, _HEAVIEST * link.length)}?"
            )
    for name, joint in (("hip", robot.hip), ("knee", robot.knee)):
        ratio = joint.motor.gear_ratio * joint.belt_ratio
        reflected = joint.motor.rotor_inertia * ratio**2
        if not _ARMATURES[0] * reflected <= joint.armature <= _ARMATURES[1] * reflected:
            yield (
                f"{origin}: '{name}.armature' is {joint.armature:.3g} kg m2, but rotor, gear and"
                f" belt reflect {reflected:.3g}; is the rotor's inertia that behind the gear?"
            )
        for path, torque in (
            (f"{name}.friction", joint.friction),
            (f"{name}.damping", joint.damping * joint.no_load_speed),
        ):
            if torque > joint.torque_limit:
                yield (
                    f"{origin}: '{path}' takes more torque than the motor gives,"
                    f" {joint.torque_limit:g} N m; check both."
                )
    if robot.kind == "leg" and not _stands(robot):
        yield (
            f"{origin}: within 'hip.lower' to 'knee.upper' the foot never comes below the hip; is a"
            " joint's sign wrong, or does the knee bend forward?"
        )
    weight = robot.mass * GRAVITY
    if robot.rail.friction > weight:
        yield (
            f"{origin}: 'rail.friction' is {robot.rail.friction:g} N, more than the leg's weight,"
            f" {weight:.3g}; it would hang on the rail."
        )
    missing = sorted(_STOPS - {path for path, _ in numbers(stated)})
    if missing and robot.kind == "leg":
        yield f"{origin} does not state {', '.join(missing)}; leg V2's mechanical stops are taken."


def _stands(robot: Robot) -> bool:
    """Tell whether some posture within the soft limits has the foot straight below the hip."""
    knee = np.linspace(robot.knee.lower, robot.knee.upper, 50)
    thigh, shank = robot.thigh.length, robot.shank.length
    hip = np.arctan2(-shank * np.sin(knee), thigh + shank * np.cos(knee))
    return bool(np.any((robot.hip.lower <= hip) & (hip <= robot.hip.upper)))


def _slip(value: float, unit: str, low: float, high: float) -> str:
    """Return the likely reason why a value lies beyond bounds, as part of a sentence."""
    for factor, other in _SLIPS[unit].items():
        if low <= value * factor <= high:
            return f"is it in {other}"
    if unit == "1" and low <= 1 / value <= high:
        return "is it inverted"
    powers = [n for n in (1, 2, 3, -1, -2, -3) if low <= value / 10**n <= high]
    return "is its decimal point right" if powers else "is its unit right"


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
                    f" '{name}.stop_{key}' ({getattr(joint, f'stop_{key}'):g});"
                    f" {'is it in degrees?' if inner - outer > math.tau else 'state both.'}"
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
                f" ({servo.max_current:g} A) and '{name}.motor.gear_ratio' ({ratio:g}) gives"
                f" {most:.3g} N m at most; {_slip(ratio, '1', 1.0, math.inf)}?"
            )
        fastest = speed_constant(servo) * robot.hardware.voltage_high / ratio
        if (speed := joint.motor.no_load_speed) > fastest * _ROUNDING:
            yield (
                f"'{name}.motor.no_load_speed' is {speed:g} rad/s but by"
                f" {constant} {voltage} ({robot.hardware.voltage_high:g} V) turns it at"
                f" {fastest:.3g} rad/s at most; {_slip(speed, 'rad/s', 0.0, fastest)}?"
            )
        if joint.load_friction >= 1:
            yield (
                f"'{name}.load_friction' is {joint.load_friction:g} but a gear that takes all that"
                " it gets never turns; give less than 1."
            )
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        end = f"{name}.{'extent' if link.extent else 'length'}"
        yield from _above(f"{name}.com", link.com, end, link.reach, "m")
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
