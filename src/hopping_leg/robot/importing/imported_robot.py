"""A robot file's tables for a leg that was imported: every number with where it comes from.

In this order: what the user gives, what the file states, what the named motor has, what is assumed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hopping_leg.errors import RobotError, UsageError, unknown_name
from hopping_leg.io import Tree, replace_at, safe_file_name
from hopping_leg.robot.hardware import Hardware, torque_constant
from hopping_leg.robot.importing.description import read_description
from hopping_leg.robot.importing.known_numbers import (
    GIVEN,
    MOTORS,
    Entry,
    Given,
    known_numbers,
)
from hopping_leg.robot.importing.leg_parts import Names
from hopping_leg.robot.importing.planar_leg import PlanarLeg, planar_leg
from hopping_leg.robot.parameters import DEFAULT_STOPS, JOINTS
from hopping_leg.robot.robot_checks import numbers
from hopping_leg.robot.robot_files import load_tree

_TEMPLATE = "legv2"
"""Shipped robot whose file gives the order and units of numbers."""
_SOFT = {"hip": (0.2, 1.2), "knee": (-2.3, -0.6)}
_INSET = 0.1  # rad, of a soft limit from its stop where leg V2's does not fit
_RATED_SHARE = 0.375  # rated over peak torque of the qdd100

_ASSUMED: dict[str, tuple[float, str]] = {
    "base.radius": (0.05, "a motor's housing of 0.1 m"),
    "rail.friction": (0.0, "unknown until identified"),
    "rail.damping": (0.0, "unknown until identified"),
    "knee_cap.radius": (0.02, "as legv2; only touches the ground in a fall"),
    "foot.radius": (0.01, "as legv2"),
    "contact.time_constant": (0.02, "MuJoCo's default ground"),
    "contact.damping_ratio": (1.0, "MuJoCo's default ground"),
    "contact.friction": (1.0, "MuJoCo's default ground"),
    **{f"{joint}.friction": (0.0, "unknown until identified") for joint in JOINTS},
    **{f"{joint}.damping": (0.0, "unknown until identified") for joint in JOINTS},
    **{f"{joint}.belt_ratio": (1.0, "the motor drives the joint directly") for joint in JOINTS},
}


@dataclass(frozen=True)
class ImportedRobot:
    """Tables of a robot file, and what was assumed in them."""

    tree: Tree
    comment: str
    assumed: dict[str, str]
    """Why, by path."""


def read_leg(path: Path, names: Names) -> PlanarLeg:
    """Return the leg that a URDF or MJCF file describes.

    Raises:
        RobotError: The file is neither, or holds no leg that moves in a plane.
    """
    return planar_leg(read_description(path), names, str(path))


def read_values(words: tuple[str, ...]) -> dict[str, float]:
    """Return numbers given as ``path=value``; ``motor.X`` stands for both joints' ``motor.X``.

    Raises:
        UsageError: A path or value is none.
    """
    valid = units()
    values: dict[str, float] = {}
    for word in words:
        path, _, text = word.partition("=")
        paths = [f"{joint}.{path}" for joint in JOINTS] if path.startswith("motor.") else [path]
        if paths[0] not in valid:
            raise UsageError(f"--set {word}: {unknown_name('number', path, valid)}")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UsageError(f"--set {word}: give a number in {valid[paths[0]]}.")
        values |= dict.fromkeys(paths, value)
    return values


def units() -> dict[str, str]:
    """Return the unit of every number that a robot file may state, by path."""
    found = {}
    for path, entry in numbers(load_tree(_TEMPLATE)):
        found[path] = str(entry["unit"])
        if path.endswith(".belt_ratio"):
            found[path.replace("belt_ratio", "armature")] = "kg m2"
    servo = {"torque_constant": "N m/A", "winding_resistance": "ohm", "max_current": "A"}
    found |= {f"hardware.{j}.{name}": unit for j in JOINTS for name, unit in servo.items()}
    return {**found, "hardware.bus_voltage": "V", "hardware.voltage_high": "V"}


def imported_robot(
    leg: PlanarLeg,
    given: Given,
    origin: str,
    ask: Callable[[str, str, float | None], float | None] | None = None,
) -> ImportedRobot:
    """Return a robot file's tables for a leg.

    Args:
        leg: What the file describes.
        given: What the user says beside it.
        origin: The file, for sources and messages.
        ask: Asked for numbers that nobody knows, by path, unit and what would be assumed, if
            anything; it returns None where it does not know either.

    Raises:
        RobotError: Numbers are missing that cannot be assumed, or there is no such motor.
    """
    entries, assumed = known_numbers(leg, given, origin), {}
    valid, missing = units(), []
    for path, unit in valid.items():
        if path in entries or path.startswith("hardware.") or path.endswith(".armature"):
            continue
        value, why = _assumption(path, entries)
        answer = value if ask is None else ask(path, unit, value)
        if answer is None:
            above = path.endswith(".com")  # a link with mass always has one, but not always below
            missing.append(f"{path} ({unit}{', it lies above the joint' if above else ''})")
        elif answer == value:
            entries[path], assumed[path] = (answer, f"assumed: {why}"), why
        else:
            entries[path] = answer, GIVEN
    for joint in JOINTS:
        path, why = f"hardware.{joint}.torque_constant", "that of the motor's no-load speed"
        speed, gear = (entries.get(f"{joint}.motor.{k}") for k in ("no_load_speed", "gear_ratio"))
        if path not in entries and speed and gear:
            constant = torque_constant(speed[0] * gear[0] / Hardware.bus_voltage)
            why = f"{why} at {Hardware.bus_voltage:g} V"
            entries[path], assumed[path] = (constant, f"assumed: {why}"), why
    if missing:
        raise RobotError(f"{origin} does not say {', '.join(missing)}; {_how_to_give(missing)}")
    tree: Tree = {
        "name": safe_file_name(leg.name),
        "description": f"imported from {Path(origin).name}",
    }
    for path in (path for path in valid if path in entries):
        value, source = float(f"{entries[path][0]:.12g}"), entries[path][1]
        tree = replace_at(tree, path, {"value": value, "unit": valid[path], "source": source})
    return ImportedRobot(tree, _comment(leg, origin), assumed)


def _how_to_give(missing: list[str]) -> str:
    motors = [path for path in missing if ".motor." in path]
    named = f"name the motor, --motor {' or '.join(MOTORS)}, or " if motors else ""
    first = (motors or missing)[0].split()[0]
    short = first.partition(".")[2] if motors else first
    return f"{named}give each as --set {short}=NUMBER."


def _assumption(path: str, known: dict[str, Entry]) -> tuple[float | None, str]:
    """Return what is assumed for a number that nobody stated, and why; None if nothing can be."""
    if path in _ASSUMED:
        return _ASSUMED[path]
    joint, _, name = path.partition(".")
    if joint in JOINTS and name.startswith("stop_"):
        reach = DEFAULT_STOPS[joint]
        return (-reach if name == "stop_lower" else reach), "as legv2; measure where it ends"
    if joint in JOINTS and name in ("lower", "upper"):
        return _soft_limit(joint, name, known)
    torque = known.get(f"{joint}.motor.torque_limit")
    peak = known.get(f"{joint}.motor.peak_torque")
    if name == "motor.torque_limit" and peak is not None:
        return peak[0], "the peak torque"
    if name == "motor.peak_torque" and torque is not None:
        return torque[0], "the torque limit; a motor may give more"
    if name == "motor.rated_torque" and (peak or torque):
        return _RATED_SHARE * (peak or torque or (0.0, ""))[0], "the qdd100's share of its peak"
    return None, ""


def _soft_limit(joint: str, end: str, known: dict[str, Entry]) -> tuple[float, str]:
    """Return leg V2's soft limit where it fits between the stops, else one inside its stop."""
    reach = DEFAULT_STOPS[joint]
    low, high = (
        known.get(f"{joint}.stop_{which}", (default, ""))[0]
        for which, default in (("lower", -reach), ("upper", reach))
    )
    if joint == "knee":
        low, high = max(low, -math.pi), min(high, 0.0)
    usual = _SOFT[joint]
    fits = low <= usual[0] and usual[1] <= high
    if fits:
        return usual[0 if end == "lower" else 1], "as legv2"
    inset = min(_INSET, (high - low) / 4)
    return (low + inset if end == "lower" else high - inset), f"{inset:.2g} rad inside the stop"


def _comment(leg: PlanarLeg, origin: str) -> str:
    """Return the lines above the tables: what was read and how angles translate."""
    lines = [
        f"Imported from {Path(origin).name}; every number says where it is from. Hip 0 is straight",
        "down, positive swings the foot forward; knee 0 is straight, negative bends it.",
        f"In the coordinates of {Path(origin).name}:",
    ]
    for name, joint in (("hip", leg.hip), ("knee", leg.knee)):
        sign = "" if joint.sign > 0 else "-"
        shifted = f"({joint.name} - {joint.zero:.6g})" if joint.zero else joint.name
        side = "-" if joint.offset < 0 else "+"
        offset = f" {side} {abs(joint.offset):.6g} rad" if joint.offset else ""
        lines.append(f"  {name} = {sign}{shifted}{offset}")
    return "\n".join([*lines, *leg.notes])
