"""From a robot file's tables to typed parameters; each mistake gets a sentence with its field."""

import dataclasses
import difflib
import math
from typing import Any, TypeVar

from hopping_leg.errors import RobotError, unknown_name
from hopping_leg.robot import hardware
from hopping_leg.robot.model import TIMESTEP
from hopping_leg.robot.parameters import KINDS, Robot

Tree = dict[str, Any]
"""Nested tables as read from TOML."""

Field = dataclasses.Field[Any]
Kind = TypeVar("Kind")

_ENTRIES = ("value", "unit", "source")
_MAY_BE_ZERO = {"friction", "damping"}
_MAY_BE_NEGATIVE = {"lower", "upper"}


def build(kind: type[Kind], tree: object, prefix: str, origin: str) -> Kind:
    """Return the dataclass that a table describes.

    Args:
        kind: Dataclass whose number fields carry their unit in ``metadata``.
        tree: The table.
        prefix: Path of the table inside the file, e.g. ``"hip.motor"``; empty for the file.
        origin: The file, for messages.

    Raises:
        RobotError: A field is missing, unknown, or holds something else than it should.
    """
    if not isinstance(tree, dict):
        raise RobotError(f"{origin}: '{prefix}' must be a table, not {tree!r}.")
    fields: dict[str, Field] = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    _check_names(tree, fields, prefix, origin)
    values: dict[str, Any] = {}
    for name, spec in fields.items():
        path = f"{prefix}.{name}" if prefix else name
        if name not in tree:
            if spec.default is spec.default_factory is dataclasses.MISSING:
                raise RobotError(f"{origin}: '{path}' is missing; it needs {_form(spec)}.")
        elif spec.type is str:
            values[name] = _string(tree[name], path, origin)
        elif isinstance(spec.type, type) and dataclasses.is_dataclass(spec.type):
            values[name] = build(spec.type, tree[name], path, origin)
        else:
            values[name] = _number(tree[name], spec, path, origin)
    return kind(**values)


def check_physics(robot: Robot, origin: str) -> None:
    """Check what no single field can tell.

    Raises:
        RobotError: Naming the fields that contradict each other.
    """
    for name, joint in (("hip", robot.hip), ("knee", robot.knee)):
        motor = joint.motor
        _below(origin, (f"{name}.lower", joint.lower), (f"{name}.upper", joint.upper), "rad")
        for smaller in ("torque_limit", "rated_torque"):
            _at_most(
                origin,
                (f"{name}.motor.{smaller}", getattr(motor, smaller)),
                (f"{name}.motor.peak_torque", motor.peak_torque),
                "N m",
            )
        if joint.load_friction >= 1:
            raise RobotError(
                f"{origin}: '{name}.load_friction' is {joint.load_friction:g} but a gear that takes"
                " all that it gets never turns; give less than 1."
            )
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        _at_most(origin, (f"{name}.com", link.com), (f"{name}.length", link.length), "m")
    if robot.kind not in KINDS:
        raise RobotError(f"{origin}: 'kind': {unknown_name('kind of robot', robot.kind, KINDS)}")
    if robot.kind == "leg" and (robot.knee.lower < -math.pi or robot.knee.upper > 0):
        raise RobotError(
            f"{origin}: 'knee.lower' and 'knee.upper' must lie between -pi and 0 rad,"
            " because a leg's knee bends to the negative side;"
            " for a robot that only swings write kind = 'pendulum'."
        )
    _check_mismatch(robot, origin)
    wiring = hardware.mistake(robot.hardware)
    if wiring is not None:
        raise RobotError(f"{origin}: {wiring}")
    least = 2 * TIMESTEP
    if robot.contact.time_constant < least:
        raise RobotError(
            f"{origin}: 'contact.time_constant' is {robot.contact.time_constant:g} s but must be at"
            f" least {least:g} s, two physics steps; MuJoCo would silently take that instead."
        )


def _check_mismatch(robot: Robot, origin: str) -> None:
    """Check what no single field of ``[reality]`` can tell."""
    reality = robot.reality
    for name, joint, drive in (("hip", robot.hip, reality.hip), ("knee", robot.knee, reality.knee)):
        at = f"reality.{name}"
        if drive.efficiency > 1:
            raise RobotError(
                f"{origin}: '{at}.efficiency' is {drive.efficiency:g} but no gear gives more than"
                " it gets; give at most 1."
            )
        if drive.stiction < 1:
            raise RobotError(
                f"{origin}: '{at}.stiction' is {drive.stiction:g} but friction at rest is not below"
                " Coulomb friction; give 1 or more."
            )
        if drive.torque_limit is not None:
            peak = joint.motor.peak_torque * joint.belt_ratio
            limit = (f"{at}.torque_limit", drive.torque_limit)
            _at_most(origin, limit, (f"{name}.motor.peak_torque x belt_ratio", peak), "N m")
    softest = reality.ground.time_constant
    if softest is not None and softest < 2 * TIMESTEP:
        raise RobotError(
            f"{origin}: 'reality.ground.time_constant' is {softest:g} s but must be at least"
            f" {2 * TIMESTEP:g} s, two physics steps."
        )


def _check_names(tree: Tree, fields: dict[str, Field], prefix: str, origin: str) -> None:
    for key in tree:
        if key not in fields:
            close = difflib.get_close_matches(key, fields, n=1)
            hint = f" Did you mean '{close[0]}'?" if close else ""
            where = f"[{prefix}]" if prefix else "the file"
            valid = ", ".join(fields)
            raise RobotError(f"{origin}: {where} has no field '{key}'.{hint} Valid: {valid}.")


def _form(spec: Field) -> str:
    """Return how a field is written in a file."""
    unit = spec.metadata.get("unit")
    if unit:
        return f'{{ value = ..., unit = "{unit}", source = "..." }}'
    return "a text in quotes" if spec.type is str else f"a table [{spec.name}]"


def _string(value: object, path: str, origin: str) -> str:
    if not isinstance(value, str) or (path == "name" and not value.strip()):
        raise RobotError(f"{origin}: '{path}' must be a text in quotes, not {value!r}.")
    return value


def _number(entry: object, spec: Field, path: str, origin: str) -> float:
    if not isinstance(entry, dict) or set(entry) != set(_ENTRIES):
        raise RobotError(f"{origin}: '{path}' is {entry!r}; it needs {_form(spec)}.")
    value, unit = entry["value"], spec.metadata["unit"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RobotError(f"{origin}: '{path}' must be a finite number, not {value!r}.")
    if entry["unit"] != unit:
        raise RobotError(f"{origin}: '{path}' is in {entry['unit']!r} but must be in '{unit}'.")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise RobotError(f"{origin}: '{path}' has no source; say where {value} comes from.")
    zero_is_valid = spec.name in _MAY_BE_ZERO or spec.metadata.get("zero", False)
    signed = spec.name in _MAY_BE_NEGATIVE or spec.metadata.get("signed", False)
    if not signed and (value < 0 or (value == 0 and not zero_is_valid)):
        least = "zero or more" if zero_is_valid else "more than zero"
        raise RobotError(f"{origin}: '{path}' is {value} {unit} but must be {least}.")
    return float(value)


def _below(origin: str, low: tuple[str, float], high: tuple[str, float], unit: str) -> None:
    if low[1] >= high[1]:
        raise RobotError(
            f"{origin}: '{low[0]}' ({low[1]:g} {unit}) must lie below '{high[0]}' ({high[1]:g})."
        )


def _at_most(origin: str, low: tuple[str, float], high: tuple[str, float], unit: str) -> None:
    if low[1] > high[1]:
        raise RobotError(
            f"{origin}: '{low[0]}' ({low[1]:g} {unit}) must not exceed '{high[0]}' ({high[1]:g})."
        )
