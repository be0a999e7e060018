"""What is known of an imported leg: what the user gives, the file states, the named motor has.

In this order; each number with its source, by its path in a robot file.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot.importing.planar_leg import PlanarJoint, PlanarLeg, PlanarLink
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.robot.robot_checks import PLAUSIBLE
from hopping_leg.robot.robot_files import load_tree

MOTORS = {"qdd100": ("legv2", "hip"), "ak80-9": ("legv1", "hip"), "ak80-6": ("legv1", "knee")}
"""Motors by name: the shipped robot and joint whose file has their numbers."""

GIVEN = "given to `hop robots import`"
"""Source of what the user says."""

_TURN = 2 * math.pi

Entry = tuple[float, str]
"""A number and its source."""


@dataclass(frozen=True)
class Given:
    """What the user says beside the file."""

    motors: tuple[str, ...] = ()
    """One motor for both joints, or the hip's and the knee's, of ``MOTORS``."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Numbers by their path in a robot file, SI units."""


def known_numbers(leg: PlanarLeg, given: Given, origin: str) -> dict[str, Entry]:
    """Return the numbers that are given, stated or the motor's, by path."""
    file = Path(origin).name
    motors = motor_numbers(given.motors) if given.motors else {}
    entries: dict[str, Entry] = {}
    if leg.base_mass > 0:
        entries["base.mass"] = leg.base_mass, f"{file}, {_bodies(leg.base_bodies)}"
    for name, link in (("thigh", leg.thigh), ("shank", leg.shank)):
        entries |= {f"{name}.{key}": value for key, value in _link(link, leg, name, file).items()}
    where = f"{file}, sphere"
    entries |= {f"{name}.radius": (radius, where) for name, radius in leg.radii.items()}
    entries |= {f"contact.{key}": (v, f"{file}, floor") for key, v in leg.ground.items()}
    entries |= {
        f"rail.{key}": (leg.rail[key], f"{file}, the rail's joint")
        for key in ("friction", "damping")
        if key in leg.rail
    }
    chosen = {path: (value, GIVEN) for path, value in given.values.items()}
    for name, joint in (("hip", leg.hip), ("knee", leg.knee)):
        entries |= _joint(name, joint, f"{file}, joint {joint.name}", chosen, motors.get(name, {}))
    return {**entries, **chosen}


def _link(link: PlanarLink, leg: PlanarLeg, name: str, file: str) -> dict[str, Entry]:
    """Return a link's numbers; what cannot be is left out."""
    foot = f"'{leg.foot}'"
    ends = f"{leg.hip.name} to {leg.knee.name}" if name == "thigh" else f"{leg.knee.name} to {foot}"
    lump = f"{file}, {_bodies(link.bodies)}"
    beside = ""
    if abs(link.beside) > 1e-6:
        beside = f"; {1e3 * abs(link.beside):.2g} mm beside the line are left out"
    entries = {"length": (link.length, f"{file}, {ends}")}
    if link.mass > 0:
        entries["mass"] = link.mass, lump
    if link.mass > 0 and link.com > 0:
        entries["com"] = link.com, f"{lump}, along the link{beside}"
    if link.inertia > 0:
        entries["inertia"] = link.inertia, f"{lump}, about the centre of mass"
    return entries


def _bodies(names: tuple[str, ...]) -> str:
    return " + ".join(names)


def _joint(
    name: str, joint: PlanarJoint, where: str, chosen: dict[str, Entry], motor: dict[str, Entry]
) -> dict[str, Entry]:
    """Return a joint's numbers, with its motor's."""
    facts = joint.facts
    entries = {
        f"{name}.{key}": (facts[key], where) for key in ("friction", "damping") if key in facts
    }
    for kind, ends in (("", ("stop_lower", "stop_upper")), ("soft_", ("lower", "upper"))):
        for end, path in zip(("lower", "upper"), ends, strict=True):
            value = facts.get(f"{kind}{end}")
            if value is not None and abs(value) <= _TURN:
                entries[f"{name}.{path}"] = value, where
    entries |= {f"{name}.{path}": entry for path, entry in motor.items() if "." in path}
    entries |= {f"hardware.{name}.{p}": entry for p, entry in motor.items() if "." not in p}
    gear_path, belt_path = f"{name}.motor.gear_ratio", f"{name}.belt_ratio"
    gear = chosen.get(gear_path) or entries.get(gear_path)
    belt = chosen.get(belt_path, (1.0, ""))[0]
    if (armature := facts.get("armature", 0.0)) > 0:
        source = f"{where}, armature"
        entries[f"{name}.armature"] = armature, source
        if gear is not None and not motor:
            rotor = armature / (gear[0] * belt) ** 2, f"{source}, over gear and belt squared"
            entries[f"{name}.motor.rotor_inertia"] = rotor
    for path, fact, factor in (
        ("torque_limit", "effort", 1 / belt),
        ("no_load_speed", "velocity", belt),
    ):
        at, value, source = (
            f"{name}.motor.{path}",
            facts.get(fact, 0.0) * factor,
            f"{where}, {fact}",
        )
        low, high = PLAUSIBLE[path]
        if low <= value <= high:  # else it stands for no limit
            bound = "peak_torque" if path == "torque_limit" else path
            most = chosen.get(f"{name}.motor.{bound}") or entries.get(f"{name}.motor.{bound}")
            if most is not None and most[0] < value:
                value, source = most[0], f"{most[1]}; less than {source}"
            entries[at] = value, source
    return entries


def motor_numbers(names: tuple[str, ...]) -> dict[str, dict[str, Entry]]:
    """Return the numbers of hip's and knee's motors: ``motor.X``, and X of the drive."""
    if len(names) > len(JOINTS):
        raise UsageError(f"{len(names)} motors were given; give one, or the hip's and the knee's.")
    found = {}
    for joint, name in zip(JOINTS, names * 2, strict=False):
        if name not in MOTORS:
            others = "for another, give its numbers, e.g. --set motor.gear_ratio=9"
            raise UsageError(f"{unknown_name('motor', name, MOTORS)} Or, {others}.")
        robot, its = MOTORS[name]
        tree = load_tree(robot)
        entries = {f"motor.{key}": entry for key, entry in tree[its]["motor"].items()}
        entries |= tree.get("hardware", {}).get(its, {})
        found[joint] = {
            key: (entry["value"], f"{name} as in {robot}: {entry['source']}")
            for key, entry in entries.items()
        }
    return found
