"""Write ``legv2-identified``: leg V2 as the lab's recordings of it tell it.

``python -m studies.identification.real_leg FOLDER FILE`` reads the folder of recordings and writes
the robot file. With a clamped base, a number is that of a fit to all recordings, and its interval
the hull of the 95 % intervals of that fit and of those that leave one recording out each: the
drives' own loop is known only roughly, and the fits differ by more than each admits. Hopping on the
boom the leg was commanded in torques. What both rigs tell is the mean of their two numbers, and its
interval holds the boom's, too.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.result import Identified
from hopping_leg.io import Tree, replace_at, write_atomically
from hopping_leg.robot import load_robot, robot_from_tree, robot_text
from studies.identification.real import RIGS

BY_BOTH = ("thigh.inertia", "hip.friction", "knee.friction", "knee.armature")
"""What a clamped leg and one on the boom tell of the robot."""

TOLD = ("thigh.com", "shank.com", "hip.damping", "knee.damping", *BY_BOTH)
"""What a clamped leg tells; the rest stays as the CAD program has it."""

_COMMENT = """\
Leg V2 as the lab's recordings tell it; what they do not tell stays CAD.
Made by `python -m studies.identification.real_leg FOLDER FILE`: least squares on
{names}.
[F] clamped base: the fit to all recordings, its interval the hull of the 95 % intervals of that fit
and of those that leave one recording out; [B] the boom, where torques were commanded; [F, B] the
mean of both and the hull of their intervals. Fitted with them, but no part of the robot: gains and
delay of the drives' own loop, the torque-speed line, which the supply of that day bounds, and on
the boom rail, ground, gear loss and the mass at the base.
The hip's armature stays the CAD's; thigh and rotor move the hip alike, so thigh.inertia has what
both miss. The lab's own files take L2 = 0.15 m, to the tip of the foot; here it is 0.14 m to its
centre, as in legv2. A clamped leg's motion does not depend on it."""


def fit(recordings: Sequence[Recording], further: tuple[str, ...] = ()) -> Identified:
    """Identify the leg from recordings, with what the plan fits besides the shank's inertia."""
    robot = load_robot("legv2")
    names = make_plan(recordings, robot).parameters.names
    told = tuple(name for name in (*names, *further) if name != "shank.inertia")
    return identify(recordings, robot, options=IdentifyOptions(parameters=told))


def ends(fits: Sequence[Identified], name: str) -> tuple[float, float, float]:
    """Return a number as the first fit has it, and the hull of all fits' intervals."""
    known = [one.identifiability for one in fits]
    pairs = [(k.values[k.names.index(name)], k.half_width[k.names.index(name)]) for k in known]
    low, high = min(v - h for v, h in pairs), max(v + h for v, h in pairs)
    return float(pairs[0][0]), max(float(low), 0.0), float(high)


def robot_tree(clamped: Sequence[Identified], boom: Identified) -> Tree:
    """Return the robot file's tables."""
    tree: Tree = {
        "name": "legv2-identified",
        "description": "leg V2 as the lab's recordings tell it",
        "extends": "legv2",
    }
    units = {p.name: p.unit for p in clamped[0].plan.parameters.parameters}
    for name in TOLD:
        (value, low, high), source = ends(clamped, name), "[F]"
        if name in BY_BOTH:
            other, least, most = ends([boom], name)
            source = f"[F, B] {value:.3g} and {other:.3g};"
            value, low, high = (value + other) / 2, min(low, least), max(high, most)
        source = f"{source} 95 % interval {low:.3g} to {high:.3g}"
        entry = {"value": float(f"{value:.4g}"), "unit": units[name], "source": source}
        tree = replace_at(tree, name, entry)
    return tree


def main(folder: Path, file: Path) -> None:
    """Fit, and write the robot file."""
    loaded = {
        rig: [load_recording(path) for path in sorted((folder / rig).glob("*.csv.gz"))]
        for rig in (RIGS["leg V2, fixed base"], "legv2_boom")
    }
    clamped, hopping = loaded.values()
    hopping = [r for r in hopping if r.has("torque_command")]
    chosen = [clamped, *([r for r in clamped if r is not left] for left in clamped)]
    tree = robot_tree([fit(some) for some in chosen], fit(hopping, ("base.mass",)))
    names = ",\n".join(Path(r.name).name for r in (*clamped, *hopping))
    robot_from_tree(tree, str(file))
    write_atomically(file, robot_text(tree, _COMMENT.format(names=names)).encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
