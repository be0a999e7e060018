"""Robot files: one TOML per leg, every number with its unit and source."""

import itertools
import json
import math
import tomllib
from collections.abc import Iterator
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import Field, Tree, is_number, read_dataclass
from hopping_leg.robot.hardware import contradictions
from hopping_leg.robot.model import TIMESTEP
from hopping_leg.robot.parameters import JOINTS, KINDS, Robot

_SHIPPED = resources.files("hopping_leg.robot") / "robots"


def shipped_robots() -> list[str]:
    """Return the names of the robots that come with the package."""
    names = (file.name for file in _SHIPPED.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot by shipped name, e.g. ``"legv2"``, or from a file that ends in ``.toml``.

    Raises:
        RobotError: Naming the file, the field and what was valid.
    """
    origin = str(name_or_path)
    return robot_from_tree(_read(origin), origin)


def robot_from_tree(tree: Tree, origin: str) -> Robot:
    """Return the robot that tables describe, ``extends`` resolved; messages name ``origin``.

    Raises:
        RobotError: Naming origin, field and what was valid.
    """
    resolved = _extend(tree, origin, ())
    _refuse_moved(resolved, origin)
    read_quantity = partial(_read_quantity, origin)
    robot = read_dataclass(Robot, resolved, origin, error=RobotError, read_quantity=read_quantity)
    if not robot.name.strip():
        raise RobotError(f"{origin}: 'name' is empty; give the robot a name.")
    check_physics(robot, origin)
    return robot


def _refuse_moved(tree: Tree, origin: str) -> None:
    """Name the new place of the mechanical stops to who has them in ``[hardware]``."""
    for joint, key in itertools.product(JOINTS, ("lower", "upper")):
        table = tree.get("hardware", {})
        table = table.get(joint, {}) if isinstance(table, dict) else {}
        if isinstance(table, dict) and key in table:
            raise RobotError(
                f"{origin}: 'hardware.{joint}.{key}' is a mechanical stop, which belongs to the"
                f" joint; write it as '{joint}.stop_{key}'."
            )


def parent_robot(name_or_path: str | Path) -> str | None:
    """Return the name or path of the robot that a file extends, None if it stands alone.

    Raises:
        RobotError: The file is missing or not TOML.
    """
    origin = str(name_or_path)
    parent = _read(origin).get("extends")
    return _beside(origin, parent) if isinstance(parent, str) else None


def load_tree(name_or_path: str | Path) -> Tree:
    """Return a robot file as nested tables with units and sources, ``extends`` resolved.

    Raises:
        RobotError: The file, or one that it extends, is missing or not TOML.
    """
    return _resolve(str(name_or_path), ())


def _resolve(name: str, chain: tuple[str, ...]) -> Tree:
    if name in chain:
        circle = " -> ".join((*chain, name))
        raise RobotError(f"{name}: robots extend each other in a circle ({circle}).")
    return _extend(_read(name), name, chain)


def _extend(tree: Tree, name: str, chain: tuple[str, ...]) -> Tree:
    parent = tree.get("extends")
    if "extends" not in tree:
        return tree
    tree = {key: value for key, value in tree.items() if key != "extends"}
    if not isinstance(parent, str):
        raise RobotError(f"{name}: 'extends' must be a robot's name or file, not {parent!r}.")
    return _merge(_resolve(_beside(name, parent), (*chain, name)), tree)


def _beside(name: str, parent: str) -> str:
    if parent.endswith(".toml") and name.endswith(".toml"):
        return str(Path(name).parent / parent)
    return parent


def _read(name: str) -> Tree:
    shipped = shipped_robots()
    if name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise RobotError(
                f"There is no robot file {path}; give a .toml file or one of: {', '.join(shipped)}."
            )
        content = path.read_bytes()
    elif name in shipped:
        content = (_SHIPPED / f"{name}.toml").read_bytes()
    else:
        raise RobotError(unknown_name("robot", name, shipped) + " Or give a .toml file.")
    try:
        return tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError(f"{name} is not valid TOML: {error}.") from error


def _merge(parent: Tree, child: Tree) -> Tree:
    """Return the parent's tables with the child's entries; a number is replaced as a whole."""
    merged = dict(parent)
    for key, value in child.items():
        inherited = merged.get(key)
        if isinstance(value, dict) and isinstance(inherited, dict) and "value" not in value:
            value = _merge(inherited, value)
        merged[key] = value
    return merged


def robot_text(tree: Tree, comment: str = "") -> str:
    """Return robot tables as TOML below a comment; numbers are ``{value, unit, source}``."""
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    _write_table(tree, "", lines)
    return "\n".join(lines).strip("\n") + "\n"


def _write_table(tree: Tree, prefix: str, lines: list[str]) -> None:
    plain = {k: v for k, v in tree.items() if not isinstance(v, dict) or "value" in v}
    if prefix and plain:
        lines += ["", f"[{prefix}]"]
    lines += [f"{key} = {_text(value)}" for key, value in plain.items()]
    for key, value in tree.items():
        if key not in plain:
            _write_table(value, f"{prefix}.{key}" if prefix else key, lines)


def _text(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_text(v)}" for k, v in value.items()) + " }"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def _read_quantity(origin: str, entry: object, spec: Field, path: str) -> float:
    unit = spec.metadata["unit"]
    if not isinstance(entry, dict) or set(entry) != {"value", "unit", "source"}:
        is_what = "missing" if entry is None else repr(entry)
        form = f'{{ value = ..., unit = "{unit}", source = "..." }}'
        raise RobotError(f"{origin}: '{path}' is {is_what}; it needs {form}.")
    value: float = entry["value"]
    if not is_number(value):
        raise RobotError(f"{origin}: '{path}' must be a finite number, not {value!r}.")
    if entry["unit"] != unit:
        raise RobotError(f"{origin}: '{path}' is in {entry['unit']!r} but must be in '{unit}'.")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise RobotError(f"{origin}: '{path}' has no source; say where {value} comes from.")
    zero_is_valid = spec.metadata.get("zero", False)
    if not spec.metadata.get("signed") and (value < 0 or (value == 0 and not zero_is_valid)):
        least = "zero or more" if zero_is_valid else "more than zero"
        raise RobotError(f"{origin}: '{path}' is {value} {unit} but must be {least}.")
    return float(value)


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
        if joint.load_friction >= 1:
            yield (
                f"'{name}.load_friction' is {joint.load_friction:g} but a gear that takes all that"
                " it gets never turns; give less than 1."
            )
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        yield from _above(f"{name}.com", link.com, f"{name}.length", link.length, "m")
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
