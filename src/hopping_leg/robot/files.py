"""Robot files: one TOML per leg, every number with its unit and source."""

import dataclasses
import difflib
import math
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.robot.parameters import Robot

_SHIPPED = resources.files("hopping_leg.robot") / "robots"
_MAY_BE_ZERO = {"friction", "damping"}
_MAY_BE_NEGATIVE = {"lower", "upper"}
_TEXT = {"name", "description", "extends"}

Tree = dict[str, Any]


def shipped_robots() -> list[str]:
    """Return the names of the robots that come with the package."""
    return sorted(f.name.removesuffix(".toml") for f in _SHIPPED.iterdir() if f.name.endswith(".toml"))


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot by shipped name or from a TOML file.

    Args:
        name_or_path: ``"legv2"``, or the path of a file that ends in ``.toml``.

    Raises:
        RobotError: Naming the file, the field and what was valid.
    """
    tree = load_tree(name_or_path)
    robot: Robot = _build(Robot, tree, "", str(name_or_path))
    _check_physics(robot, str(name_or_path))
    return robot


def load_tree(name_or_path: str | Path) -> Tree:
    """Return a robot file as nested tables with units and sources, ``extends`` resolved."""
    return _resolve(str(name_or_path), ())


def _resolve(name: str, chain: tuple[str, ...]) -> Tree:
    if name in chain:
        raise RobotError(f"{name}: robots extend each other in a circle ({' -> '.join(chain)}).")
    tree = _read(name)
    parent = tree.get("extends")
    if parent is None:
        return tree
    return _merge(_resolve(_beside(name, str(parent)), (*chain, name)), tree)


def _beside(name: str, parent: str) -> str:
    """Resolve a parent's path relative to the file that names it."""
    if parent.endswith(".toml") and name.endswith(".toml"):
        return str(Path(name).parent / parent)
    return parent


def _read(name: str) -> Tree:
    if name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise RobotError(f"There is no robot file {path}; shipped robots: {', '.join(shipped_robots())}.")
        source: Any = path
    elif name in shipped_robots():
        source = _SHIPPED / f"{name}.toml"
    else:
        raise RobotError(unknown_name("robot", name, shipped_robots()) + " Or give a .toml file.")
    try:
        return tomllib.loads(source.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RobotError(f"{name} is not valid TOML: {error}.") from error


def _merge(parent: Tree, child: Tree) -> Tree:
    merged = dict(parent)
    for key, value in child.items():
        both_tables = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merge(merged[key], value) if both_tables and "value" not in value else value
    return merged


def _build(kind: Any, tree: Any, prefix: str, origin: str) -> Any:
    if not isinstance(tree, dict):
        raise RobotError(f"{origin}: '{prefix}' must be a table, not {tree!r}.")
    fields = {f.name: f for f in dataclasses.fields(kind)}
    for key in tree:
        if key not in fields and not (prefix == "" and key in _TEXT):
            close = difflib.get_close_matches(key, fields, n=1)
            hint = f"did you mean '{close[0]}'? Valid" if close else "valid"
            where = f"[{prefix}]" if prefix else "the file"
            raise RobotError(f"{origin}: {where} has no field '{key}'; {hint}: {', '.join(fields)}.")
    values = {}
    for name, spec in fields.items():
        path = f"{prefix}.{name}" if prefix else name
        if name not in tree:
            if spec.default is dataclasses.MISSING:
                raise RobotError(f"{origin}: '{path}' is missing{_needs(spec)}.")
        elif dataclasses.is_dataclass(spec.type):
            values[name] = _build(spec.type, tree[name], path, origin)
        elif spec.type is str:
            values[name] = str(tree[name])
        else:
            values[name] = _number(tree[name], spec, path, origin)
    return kind(**values)


def _needs(spec: Any) -> str:
    unit = spec.metadata.get("unit")
    return f'; it needs {{ value = ..., unit = "{unit}", source = "..." }}' if unit else "; it needs a table"


def _number(entry: Any, spec: Any, path: str, origin: str) -> float:
    unit = spec.metadata["unit"]
    if not isinstance(entry, dict) or not {"value", "unit", "source"} <= entry.keys():
        raise RobotError(f"{origin}: '{path}' is {entry!r}{_needs(spec)}.")
    extra = entry.keys() - {"value", "unit", "source"}
    if extra:
        raise RobotError(f"{origin}: '{path}' has no entry {sorted(extra)[0]!r}; valid: value, unit, source.")
    value = entry["value"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RobotError(f"{origin}: '{path}' must be a finite number, not {value!r}.")
    if entry["unit"] != unit:
        raise RobotError(f"{origin}: '{path}' is in '{entry['unit']}' but must be given in '{unit}'.")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise RobotError(f"{origin}: '{path}' has no source; say where {value} comes from.")
    name = spec.name
    if name not in _MAY_BE_NEGATIVE and (value < 0 or (value == 0 and name not in _MAY_BE_ZERO)):
        least = "zero or more" if name in _MAY_BE_ZERO else "more than zero"
        raise RobotError(f"{origin}: '{path}' is {value} {unit} but must be {least}.")
    return float(value)


def _check_physics(robot: Robot, origin: str) -> None:
    for name in ("hip", "knee"):
        joint = getattr(robot, name)
        if joint.lower >= joint.upper:
            raise RobotError(f"{origin}: '{name}.lower' ({joint.lower}) must lie below '{name}.upper' ({joint.upper}).")
        if joint.motor.torque_limit > joint.motor.peak_torque:
            raise RobotError(
                f"{origin}: '{name}.motor.torque_limit' ({joint.motor.torque_limit} N m) exceeds"
                f" '{name}.motor.peak_torque' ({joint.motor.peak_torque} N m)."
            )
    for name in ("thigh", "shank"):
        link = getattr(robot, name)
        if link.com > link.length:
            raise RobotError(f"{origin}: '{name}.com' ({link.com} m) lies beyond '{name}.length' ({link.length} m).")
