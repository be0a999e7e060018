"""The identified robot as a robot file: every value with its interval, and where it comes from."""

import copy
from pathlib import Path
from typing import Any

from hopping_leg.identify.result import (
    Identified,
    parameters_json,
    quality_json,
    software_versions,
)
from hopping_leg.io import Tree, write_atomically
from hopping_leg.robot.robot_files import load_tree, robot_from_tree, robot_text

_LATENCY = "reality.latency.command"


def save_robot(identified: Identified, path: Path, origin: str | Path) -> None:
    """Write the robot file; it stands alone, and an existing file is replaced as a whole.

    Args:
        identified: What was found.
        path: A ``.toml`` file; its stem is the robot's name.
        origin: Name or path of the robot that the fit began with, for all other numbers.

    Raises:
        RobotError: The identified values make no valid robot; nothing is written.
        TraceError: The file cannot be written.
    """
    tree = _identified_tree(identified, load_tree(origin), path.stem)
    robot_from_tree(tree, str(path))
    write_atomically(path, robot_text(tree, _comment(identified, str(origin))).encode())


def _identified_tree(identified: Identified, tree: Tree, name: str) -> Tree:
    """Return a robot's tables with the identified values in place.

    The delay of the recordings' loop becomes the robot's latency, with which training simulates it.

    Args:
        identified: What was found.
        tree: Of the robot that the fit began with, ``extends`` resolved.
        name: Of the new robot.
    """
    tree = {key: copy.deepcopy(value) for key, value in tree.items() if key != "reality"}
    tree["name"] = name
    tree["description"] = f"{identified.start.robot.name}, identified from recordings"
    for row in parameters_json(identified):
        *path, last = _place(row["name"])
        if path[0] == "drive" or (path[0] == "reality" and not row["value"] > 0):
            continue
        table = tree
        for part in path:
            table = table.setdefault(part, {})
        table[last] = {"value": row["value"], "unit": row["unit"], "source": _source(row)}
    return tree


def _place(name: str) -> list[str]:
    """Return where a fit's parameter stands in a robot file, table by table."""
    return (_LATENCY if name == "drive.delay" else name).split(".")


def _comment(identified: Identified, origin: str) -> str:
    """Return what stands above the tables: provenance, quality, and what stays unknown."""
    lines = [f"Identified by `hop identify` from {origin}; numbers without 'identified' are its."]
    for use, recordings in (("Fitted to", identified.fit), ("Judged by", identified.held)):
        lines += [f"{use}: {r.name}, sha256 {r.digest or 'unknown'}" for r in recordings]
    lines.append(f"Split: {identified.split}; seed {identified.seed}; {identified.plan.search}.")
    versions = software_versions().items()
    lines.append("Versions: " + ", ".join(f"{name} {value}" for name, value in versions) + ".")
    lines += _quality(identified)
    rows = parameters_json(identified)
    drives = [row for row in rows if _place(row["name"])[0] == "drive"]
    if drives:
        lines.append("Of the recordings' drives, which are no part of the robot:")
        lines += [f"  {r['name']} = {r['value']:.6g} {r['unit']} ({_source(r)})" for r in drives]
    if identified.identifiability.statements:
        lines.append("What these data cannot tell:")
        lines += [f"  {sentence}" for sentence in identified.identifiability.statements]
    return "\n".join(lines)


def _quality(identified: Identified) -> list[str]:
    lines = ["Error on what judged (rms; hip, knee), before and after the fit:"]
    for row in quality_json(identified):
        before, after = (
            f"{row[f'hip_{when}']:.3g}, {row[f'knee_{when}']:.3g}" for when in ("before", "after")
        )
        lines.append(f"  {row['error']}: {before} and {after} {row['unit']}")
    return lines


def _source(row: dict[str, Any]) -> str:
    low, high, unit = row["interval_low"], row["interval_high"], row["unit"]
    at_bound = "; at a bound of its search" if row["at_bound"] else ""
    if not abs(high - low) < float("inf"):
        return f"identified, but these data say nothing about it; start {row['start']:.6g}"
    return f"identified: 95 % {low:.6g} to {high:.6g} {unit}, start {row['start']:.6g}{at_bound}"
