"""Robot files: one TOML per leg, every number with its unit and source."""

import dataclasses
import json
import logging
from importlib import resources
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, get_type_hints

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.io import Tree, is_number, one_line, parse_toml, read_dataclass
from hopping_leg.robot.parameters import Robot
from hopping_leg.robot.robot_checks import check_physics, find_doubts, unfit_numbers

DEFAULT_ROBOT = "legv2-identified"
"""The best-supported robot: the leg as its own recordings tell it."""

_SHIPPED = resources.files("hopping_leg.robot") / "robots"

_LARGEST = 1e12  # magnitude of any number, whatever its unit
_log = logging.getLogger(__name__)
_told: set[str] = set()


def shipped_robots() -> list[str]:
    """Return the names of the robots that come with the package."""
    names = (file.name for file in _SHIPPED.iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot by shipped name, e.g. ``"legv2"``, or from a file that ends in ``.toml``.

    Doubts about a file's numbers (``doubts``) are logged as warnings, once. RobotError names the
    file, the field and what was valid.
    """
    origin = str(name_or_path)
    robot = robot_from_tree(_read(origin), origin)
    for doubt in doubts(origin):
        if doubt not in _told and parent_process() is None:
            _told.add(doubt)
            _log.warning(doubt)
    return robot


def robot_from_tree(tree: Tree, origin: str) -> Robot:
    """Return the robot of tables, ``extends`` resolved; RobotError names ``origin`` and field."""
    plain = _with_values(Robot, _complete(tree, origin), origin)
    robot = read_dataclass(Robot, plain, origin, error=RobotError)
    if not robot.name.strip():
        raise RobotError(f"{origin}: 'name' is empty; give the robot a name.")
    check_physics(robot, origin)
    return robot


def parent_robot(name_or_path: str | Path) -> str | None:
    """Return what robot a file extends, None if none; RobotError where it is missing, no TOML."""
    return _parent(_read(str(name_or_path)), str(name_or_path))[0] or None


def load_tree(name_or_path: str | Path) -> Tree:
    """Return a robot file as nested tables with units and sources, ``extends`` resolved.

    RobotError says that the file, or one that it extends, is missing or not TOML.
    """
    return _complete(_read(str(name_or_path)), str(name_or_path))


def doubts(name_or_path: str | Path) -> list[str]:
    """Return sentences about numbers that may not fit each other; errors as of ``load_robot``."""
    origin = str(name_or_path)
    own = _read(origin)
    return find_doubts(robot_from_tree(own, origin), origin, own, *_parent(own, origin))


def _complete(tree: Tree, name: str, heirs: tuple[str, ...] = ()) -> Tree:
    """Return all tables of a file, those that it inherits among them.

    A stated armature holds for its own gear: a file that changes the gear does not inherit it.
    """
    own = {key: value for key, value in tree.items() if key != "extends"}
    _, inherited = _parent(tree, name, heirs)
    merged = _merge(inherited, own)
    for path in unfit_numbers(inherited, own):
        joint, _, number = path.partition(".")
        if number == "armature":
            merged[joint] = {k: v for k, v in merged[joint].items() if k != number}
    return merged


def _parent(tree: Tree, name: str, heirs: tuple[str, ...] = ()) -> tuple[str, Tree]:
    """Return name and all tables of what a file extends, which ``heirs`` extend; may be none."""
    if "extends" not in tree:
        return "", {}
    parent, heirs = tree["extends"], (*heirs, name)
    if not isinstance(parent, str):
        said = one_line(parent)
        raise RobotError(f"{name}: 'extends' must be a robot's name or file, not {said}.")
    if parent.endswith(".toml") and name.endswith(".toml"):
        parent = str(Path(name).parent / parent)
    if parent in heirs:
        circle = " -> ".join((*heirs, parent))
        raise RobotError(f"{parent}: robots extend each other in a circle ({circle}).")
    return parent, _complete(_read(parent), parent, heirs)


def _read(name: str) -> Tree:
    file = Path(name) if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    if not file.is_file():
        known = unknown_name("robot", name, shipped_robots())
        raise RobotError(f"{known} Or give a .toml file; `hop robots import` makes one of a URDF.")
    return parse_toml(file.read_bytes(), name, RobotError)


def _merge(parent: Tree, child: Tree) -> Tree:
    """Return the parent's tables with the child's entries; a number is replaced as a whole."""
    merged = dict(parent)
    for key, value in child.items():
        inherited = merged.get(key)
        if isinstance(value, dict) and isinstance(inherited, dict) and "value" not in value:
            value = _merge(inherited, value)
        merged[key] = value
    return merged


def robot_tree(part: Any, source: str) -> Tree:  # noqa: ANN401
    """Return a robot as a file's tables that stand alone, without what is at its default."""
    tables: Tree = {}
    for spec in dataclasses.fields(part):
        value, made = getattr(part, spec.name), spec.default_factory
        if dataclasses.is_dataclass(value):
            if made is dataclasses.MISSING or value != made():
                tables[spec.name] = robot_tree(value, source)
        elif value is not None and value != spec.default:
            unit = spec.metadata.get("unit")
            entry = {"value": value, "unit": unit, "source": source}
            tables[spec.name] = value if unit is None else entry
    return tables


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


def _with_values(kind: Any, tree: object, origin: str, path: str = "") -> object:  # noqa: ANN401
    """Return a dataclass' tables with the value in place of each entry of value, unit, source."""
    if not isinstance(tree, dict) or not dataclasses.is_dataclass(kind):
        return tree
    plain, hints = dict(tree), get_type_hints(kind)
    for spec in dataclasses.fields(kind):
        at = f"{path}{spec.name}"
        if "unit" not in spec.metadata:
            if spec.name in tree:
                plain[spec.name] = _with_values(hints[spec.name], tree[spec.name], origin, f"{at}.")
        elif spec.name in tree or spec.default is dataclasses.MISSING:
            plain[spec.name] = _read_quantity(origin, tree.get(spec.name), spec, at)
    return plain


def _read_quantity(origin: str, entry: object, spec: dataclasses.Field[Any], path: str) -> float:
    unit = spec.metadata["unit"]
    if not isinstance(entry, dict) or set(entry) != {"value", "unit", "source"}:
        is_what = "missing" if entry is None else one_line(entry)
        form = f'{{ value = ..., unit = "{unit}", source = "..." }}'
        raise RobotError(f"{origin}: '{path}' is {is_what}; it needs {form}.")
    value: float = entry["value"]
    if not is_number(value):
        raise RobotError(f"{origin}: '{path}' must be a finite number, not {one_line(value)}.")
    if abs(value) > _LARGEST:
        raise RobotError(f"{origin}: '{path}' is {value:.3g}, which no leg has; give it in {unit}.")
    if entry["unit"] != unit:
        raise RobotError(f"{origin}: '{path}' is in {entry['unit']!r} but must be in '{unit}'.")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise RobotError(f"{origin}: '{path}' has no source; say where {value} comes from.")
    zero_is_valid = spec.metadata.get("zero", False)
    if not spec.metadata.get("signed") and (value < 0 or (value == 0 and not zero_is_valid)):
        least = "zero or more" if zero_is_valid else "more than zero"
        raise RobotError(f"{origin}: '{path}' is {value} {unit} but must be {least}.")
    return float(value)
