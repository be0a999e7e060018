"""A robot file's tables for a leg from a URDF or MJCF file: every number with where it comes from.

In this order: what the user gives, what the file states, what the named motor has, what is assumed.
"""

import math
from collections.abc import Mapping
from pathlib import Path

from hopping_leg.errors import RobotError, UsageError, unknown_name
from hopping_leg.io import Tree, replace_at, safe_file_name
from hopping_leg.robot.hardware import Hardware, torque_constant
from hopping_leg.robot.parameters import DEFAULT_STOPS, JOINTS
from hopping_leg.robot.planar_leg import Entry, PlanarLeg
from hopping_leg.robot.robot_checks import numbers
from hopping_leg.robot.robot_files import load_tree

MOTORS = {"qdd100": ("legv2", "hip"), "ak80-9": ("legv1", "hip"), "ak80-6": ("legv1", "knee")}
"""Motors by name: the shipped robot and joint whose file has their numbers."""

_TEMPLATE = "legv2"  # Shipped robot whose file gives the order and units of numbers
_SOFT = {"hip": (0.2, 1.2), "knee": (-2.3, -0.6)}
_INSET = 0.1  # rad, of a soft limit from its stop where leg V2's does not fit
_RATED_SHARE = 0.375  # rated over peak torque of the qdd100
_LIMITS = {"torque_limit": (0.05, 300.0), "no_load_speed": (2.0, 200.0)}
"""What a motor may state as its limit, N m and rad/s; beyond, it stands for none."""

_ASSUMED: dict[str, Entry] = {
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


def read_values(words: tuple[str, ...]) -> dict[str, float]:
    """Return numbers given as ``path=value``, ``motor.X`` for both joints, or raise UsageError."""
    valid, values = _units(), dict[str, float]()
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


def _units() -> dict[str, str]:
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
    leg: PlanarLeg, origin: str, motors: tuple[str, ...] = (), values: Mapping[str, float] = {}
) -> tuple[Tree, str]:
    """Return a robot file's tables and comment for a leg that the file ``origin`` describes.

    Values are numbers that the user gives, by their path in a robot file, SI units; motors are one
    of ``MOTORS`` for both joints, or the hip's and the knee's. RobotError says which numbers are
    missing that cannot be assumed, UsageError that there is no such motor.
    """
    given = {path: (value, "given to `hop robots import`") for path, value in values.items()}
    entries = {**leg.numbers, **_motor_numbers(motors), **given}
    for joint in JOINTS:
        entries |= _motor_limits(joint, entries)
    entries |= given
    units = _units()
    assumed = {p: (v, f"assumed: {why}") for p, (v, why) in _assumptions(entries).items()}
    entries = assumed | entries
    unknown = (path for path in units if path not in entries and not path.startswith("hardware."))
    missing = [path for path in unknown if not path.endswith(".armature")]
    if missing:
        named = ", ".join(f"{path} ({units[path]})".removesuffix(" (1)") for path in missing)
        remedy = f"give each, e.g. --set {missing[0]}=1."
        if any(".motor." in path for path in missing):
            named_motor = f"name the motor, --motor {' or '.join(MOTORS)}"
            remedy = f"{named_motor}, or give each, e.g. --set motor.gear_ratio=9."
        raise RobotError(f"{origin} does not say {named}; {remedy}")
    file = Path(origin).name
    tree: Tree = {"name": safe_file_name(leg.name), "description": f"imported from {file}"}
    for path in (path for path in units if path in entries):
        value, source = entries[path]
        entry = {"value": float(f"{value:.12g}"), "unit": units[path], "source": source}
        tree = replace_at(tree, path, entry)
    comment = (
        f"Imported from {file}; every number says where it is from. Hip 0 is straight\n"
        "down, positive swings the foot forward; knee 0 is straight, negative bends it.\n"
        f"In the coordinates of {file}:\n"
    )
    return tree, comment + "\n".join(leg.notes)


def _motor_numbers(names: tuple[str, ...]) -> dict[str, Entry]:
    """Return the numbers of hip's and knee's motors and drives, by path."""
    if len(names) > len(JOINTS):
        raise UsageError(f"{len(names)} motors were given; give one, or the hip's and the knee's.")
    found: dict[str, Entry] = {}
    for joint, name in zip(JOINTS, names * 2, strict=False):
        if name not in MOTORS:
            others = "for another, give its numbers, e.g. --set motor.gear_ratio=9"
            raise UsageError(f"{unknown_name('motor', name, MOTORS)} Or, {others}.")
        robot, its = MOTORS[name]
        tree = load_tree(robot)
        entries = {f"{joint}.motor.{key}": entry for key, entry in tree[its]["motor"].items()}
        drive = tree.get("hardware", {}).get(its, {})
        entries |= {f"hardware.{joint}.{key}": entry for key, entry in drive.items()}
        said = f"{name} as in {robot}: "
        found |= {path: (e["value"], said + e["source"]) for path, e in entries.items()}
    return found


def _motor_limits(joint: str, known: dict[str, Entry]) -> dict[str, Entry]:
    """Return the limits that the file states of a joint, at its motor and within what it can."""
    entries: dict[str, Entry] = {}
    belt = known.get(f"{joint}.belt_ratio", (1.0, ""))[0]
    for name, fact, factor, bound in (
        ("torque_limit", "effort", 1 / belt, "peak_torque"),
        ("no_load_speed", "velocity", belt, "no_load_speed"),
    ):
        stated, source = known.get(f"{joint}.{fact}", (0.0, ""))
        value, most = stated * factor, known.get(f"{joint}.motor.{bound}", (math.inf, ""))
        low, high = _LIMITS[name]
        if low <= value <= high:
            less = most[0] < value
            entry = (most[0], f"{most[1]}; less than {source}") if less else (value, source)
            entries[f"{joint}.motor.{name}"] = entry
    return entries


def _assumptions(known: Mapping[str, Entry]) -> dict[str, Entry]:
    """Return what is assumed for numbers that nobody states, and why, given those known."""
    found = dict(_ASSUMED)
    for joint in JOINTS:
        at, soft, reach = f"{joint}.motor", _SOFT[joint], DEFAULT_STOPS[joint]
        for end, value in (("lower", -reach), ("upper", reach)):
            found[f"{joint}.stop_{end}"] = value, "as legv2; measure where it ends"
        stops = {**found, **known}
        low, high = (stops[f"{joint}.stop_{end}"][0] for end in ("lower", "upper"))
        if joint == "knee":
            low, high = max(low, -math.pi), min(high, 0.0)
        why, inset = "as legv2", min(_INSET, (high - low) / 4)
        if not low <= soft[0] < soft[1] <= high:
            soft, why = (low + inset, high - inset), f"{inset:.2g} rad inside the stop"
        found |= {f"{joint}.{end}": (soft[i], why) for i, end in enumerate(("lower", "upper"))}
        limit = known.get(f"{at}.torque_limit", (0.0,))
        if most := known.get(f"{at}.peak_torque", limit)[0] or limit[0]:
            found[f"{at}.torque_limit"] = most, "the peak torque"
            found[f"{at}.peak_torque"] = most, "the torque limit; a motor may give more"
            found[f"{at}.rated_torque"] = _RATED_SHARE * most, "the qdd100's share of its peak"
        if {f"{at}.no_load_speed", f"{at}.gear_ratio"} <= set(known):
            rotor = known[f"{at}.no_load_speed"][0] * known[f"{at}.gear_ratio"][0]
            constant = torque_constant(rotor / Hardware.bus_voltage)
            why = f"that of the motor's no-load speed at {Hardware.bus_voltage:g} V"
            found[f"hardware.{joint}.torque_constant"] = constant, why
    return found
