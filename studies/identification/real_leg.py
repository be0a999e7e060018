"""Write ``legv2-identified``: leg V2 with its belt, as all of the lab's recordings of it tell it.

``python -m studies.identification.real_leg --out FILE`` reads the recordings and writes the robot
file, and what else was found with ``--json``. Hops on both booms tell knee, belt,
ground and the thigh's inertia; the clamped base tells the rest of the hip. An interval is that of
the jackknife: of the fits that leave one recording out each. These fits judge, too: on every rig,
what each predicts of the recording that it has not seen must be no worse than what the CAD does,
joint by joint, else no file is written and the one sentence of the error says what is worse.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.cli.options import JsonFile
from hopping_leg.errors import PhysicsError
from hopping_leg.identify.cost import Objective
from hopping_leg.identify.optimizers import SearchOptions, least_squares
from hopping_leg.identify.parameters import LegHypothesis, parameter_units
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.simulate import cut
from hopping_leg.identify.validation import validate
from hopping_leg.io import Tree, replace_at, write_atomically
from hopping_leg.robot import JOINTS, Robot, load_robot, robot_from_tree, robot_text
from studies.shared import Row, main, recordings_folder

SETS = {
    "F": ("legv2_fixed_base", "*.csv.gz"),
    "B130": ("legv2_boom", "*torque*"),
    "B200": ("legv2_boom_200hz", "*/"),
}
"""Folders of recordings, and which of them hold torques."""
BELT = [f"reality.knee.{n}" for n in ("stiffness", "stiffness_damping", "backlash", "efficiency")]
BY_BOOM = ["knee.friction", "knee.damping", "knee.armature", "thigh.inertia", *BELT]
GRIPS = (1.0, 1.2, 1.4)
"""Friction of the ground that is tried, the best kept: whether a foot slips makes the cost jump.
Its give stays the CAD's, which hops do not tell."""
OF_BOOM = ["boom.weight", "boom.hip_friction", "drive.delay"]
"""No part of the robot."""
BY_BASE = ["thigh.com", "hip.friction", "hip.damping"]
BOUNDS = {"drive.delay": (0.0, 0.006), "reality.knee.stiffness": (50.0, 600.0)}
BELTS = ((150.0, 0.25), (250.0, 0.05))
"""Stiffness and damping, N m/rad and N m s/rad, at which searches begin: the cost has several
minima along them, and the lowest counts."""
_NINETY_FIVE = 1.96
_WORSE = 1.1  # times the start's error, geometric mean over recordings and kinds of error
_DIGITS = 4

LATENCY = "reality.latency.command"
GRIP = "contact.friction"
Values = Mapping[str, float]

_COMMENT = """\
Leg V2 with its belt as the lab's recordings tell it; what they do not tell stays CAD.
Made by `python -m studies.identification.real_leg`: least squares on
{names}.
[B] hops on both booms, the knee's torques converted to the joint, pushed by what was measured;
[F] the clamped base, whose drives' own gains are fitted beside, with [B] given and the belt rigid.
Each has the 95 % interval of the jackknife over recordings; of three frictions of the ground it is
the best, to a step. Fitted with them, but no part of the robot: the boom's weight and what it rubs
at the hip, delays, and gains of the drives' own loop.
The hip's armature stays the CAD's; thigh and rotor move the hip alike, so thigh.inertia has what
both miss."""


@dataclass(frozen=True)
class Fit:
    """Found values of all parameters, robot's and others'."""

    values: Values
    cost: float
    hypothesis: LegHypothesis


def fit(recordings: Sequence[Recording], robot: Robot, names: Sequence[str]) -> Fit:
    """Fit numbers of a robot and its drives to recordings."""
    bounds = {
        n: b for n, b in BOUNDS.items() if n in names and recordings[0].metadata.rig == "boom"
    }
    plan = make_plan(recordings, robot, parameters=tuple(names), bounds=bounds)
    windows = cut(recordings, plan.window, unscored=plan.unscored)
    objective = Objective(tuple(recordings), tuple(windows), plan.parameters, plan.scoring)
    effort = (plan.parameters, objective.loss, SearchOptions())
    found = least_squares(objective.residuals, *effort, groups=objective.jumping)
    (hypothesis,) = plan.parameters.hypotheses(found.vector[None])
    values = plan.parameters.values(found.vector).tolist()
    return Fit(dict(zip(plan.parameters.names, values, strict=True)), found.cost, hypothesis)


def with_values(robot: Robot, values: Values) -> Robot:
    """Return the robot with those of the values that are a robot's, a delay as its latency."""
    for name, value in named(values).items():
        if not name.startswith(("drive.", "boom.")):
            robot = replace_at(robot, name, value)
    return robot


def named(values: Values) -> dict[str, float]:
    """Return values by their names in a robot file: the delay on the boom is its latency."""
    return {name.replace("drive.delay", LATENCY): value for name, value in values.items()}


def gains(recordings: Sequence[Recording], robot: Robot) -> list[str]:
    """Return the names of the drives' own numbers on the clamped base."""
    names = make_plan(recordings, robot).parameters.names
    return [name for name in names if name.startswith("drive.")]


def jackknife(values: Sequence[float]) -> float:
    """Return the half width of the 95 % interval that leaving one recording out each tells."""
    n = len(values)
    spread = np.sum((np.array(values) - np.mean(values)) ** 2)
    return _NINETY_FIVE * float(np.sqrt((n - 1) / n * spread))


def judged(recording: Recording, start: LegHypothesis, fitted: LegHypothesis) -> list[Row]:
    """Return errors on a recording that no fit has seen, before and after, by joint and kind."""
    before, after = (validate([recording], h) for h in (start, fitted))
    kinds = {
        "position, rad": "closed_loop_position_rms_rad",
        "torque, N m": "closed_loop_torque_rms_nm",
    }
    pairs = {kind: (getattr(before, name), getattr(after, name)) for kind, name in kinds.items()}
    if recording.metadata.rig == "boom":
        ahead = "open_loop_position_rms_rad"
        pairs = {"position, rad": (getattr(before, ahead)["0.2"], getattr(after, ahead)["0.2"])}
    return [
        {"rig": recording.metadata.rig, "recording": recording.name, "joint": joint, "error": kind,
         "before": old[at], "after": new[at]}
        for kind, (old, new) in pairs.items()
        for at, joint in enumerate(JOINTS)
    ]  # fmt: skip


def worse(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a sentence for each rig and joint whose errors grew."""
    found = []
    for rig, joint in sorted({(row["rig"], row["joint"]) for row in rows}):
        own = [row for row in rows if (row["rig"], row["joint"]) == (rig, joint)]
        ratio = float(np.exp(np.mean([np.log(row["after"] / row["before"]) for row in own])))
        if not ratio < _WORSE:
            found.append(f"{rig}: the {joint} errs {ratio:.3g} times as much as by the CAD.")
    return found


def torque_scale(recordings: Sequence[Recording], robot: Robot, names: Sequence[str]) -> Values:
    """Return by what the motors' measured torques at the joint must be multiplied, by joint."""
    rest = [n for n in names if n != "reality.knee.efficiency"]
    robot = replace_at(robot, "reality.knee.efficiency", 1.0)
    found = fit(recordings, robot, [*rest, *(f"{joint}.torque_gain" for joint in JOINTS)])
    return {joint: found.values[f"{joint}.torque_gain"] for joint in JOINTS}


def identify(folder: Path) -> Row:
    """Fit and judge; return every number."""
    sets = {
        key: [load_recording(p) for p in sorted((folder / name).glob(pattern))]
        for key, (name, pattern) in SETS.items()
    }
    sets["B130"] = [r for r in sets["B130"] if r.has_column("base_rise_m")]
    clamped, hopping = sets["F"], [*sets["B130"], *sets["B200"]]
    cad = load_robot("legv2")
    of_boom, of_base = [*BY_BOOM, *OF_BOOM], [*BY_BASE, *gains(clamped, cad)]

    def tell(what: str, found: Fit) -> Fit:
        shown = ", ".join(f"{name} {value:.4g}" for name, value in found.values.items())
        print(f"{what}: cost {found.cost:.5g}; {shown}", flush=True)
        return found

    def hops(start: Robot, grips: Sequence[float]) -> Fit:
        tried = []
        for grip, belt in product(grips, BELTS):
            begin = with_values(start, {GRIP: grip} | dict(zip(BELT, belt, strict=False)))
            tried.append(tell(f"hops, {grip}, belt from {belt}", fit(hopping, begin, of_boom)))
        return min(tried, key=lambda one: one.cost)

    first = hops(cad, GRIPS[1:2]).hypothesis.robot
    base = tell("clamped base", fit(clamped, first, of_base))
    boom = hops(with_values(first, {n: base.values[n] for n in BY_BASE}), GRIPS)
    told = boom.hypothesis.robot
    believed = tell("clamped base by the CAD", fit(clamped, cad, gains(clamped, cad)))
    without: list[Row] = []
    rows: list[Row] = []
    for left in hopping:
        one = tell(
            f"hops without {left.name}", fit([r for r in hopping if r is not left], told, of_boom)
        )
        without.append({"recording": left.name, "values": named(one.values)})
        rows += judged(left, LegHypothesis(cad), one.hypothesis)
    bases: list[Values] = []
    for left in clamped:
        others = [r for r in clamped if r is not left]
        other = tell(f"clamped base without {left.name}", fit(others, told, of_base))
        bases.append(other.values)
        rows += judged(left, fit(others, cad, gains(clamped, cad)).hypothesis, other.hypothesis)
    scales: list[Row] = []
    for key in ("B130", "B200"):
        runs = sets[key]
        each = [torque_scale([r for r in runs if r is not left], told, of_boom) for left in runs]
        whole = torque_scale(runs, told, of_boom)
        for joint, ratio in zip(JOINTS, (1.0, cad.knee.belt_ratio), strict=True):
            half = jackknife([one[joint] for one in each])
            scales.append({"rig": SETS[key][0], "joint": joint, "scale": ratio * whole[joint],
                           "half_width": ratio * half, "recordings": len(runs)})  # fmt: skip
            print(scales[-1], flush=True)
    parameters: list[Row] = []
    for names, rig, value, fits in (
        (named(boom.values), "B", named(boom.values), [one["values"] for one in without]),
        (of_base, "F", base.values, bases),
    ):
        for name in names:
            half = jackknife([one[name] for one in fits])
            parameters.append({"name": name, "rig": rig, "value": value[name], "half_width": half,
                               "unit": parameter_units()[name]})  # fmt: skip
    parameters.append({"name": GRIP, "rig": "B", "value": told.contact.friction,
                       "half_width": GRIPS[1] - GRIPS[0], "unit": "1"})  # fmt: skip
    return {
        "parameters": parameters, "without": without, "judged": rows, "worse": worse(rows),
        "torque_scales": scales, "clamped_gains_by_the_cad": dict(believed.values),
        "recordings": [r.name for r in (*clamped, *hopping)],
    }  # fmt: skip


def robot_tree(found: Mapping[str, Any]) -> Tree:
    """Return the robot file's tables."""
    tree: Tree = {
        "name": "legv2-identified",
        "description": "leg V2 with its belt, as the lab's recordings tell it",
        "extends": "legv2",
    }
    for one in found["parameters"]:
        name, value, half = (one[key] for key in ("name", "value", "half_width"))
        if not name.startswith(("drive.", "boom.")):
            low, high = max(value - half, 0.0), value + half
            source = f"[{one['rig']}] 95 % interval {low:.3g} to {high:.3g}"
            rounded = float(f"{value:.{_DIGITS}g}")
            entry = {"value": rounded, "unit": one["unit"], "source": source}
            tree = replace_at(tree, name, entry)
    return tree


@dataclass(frozen=True)
class RealLeg:
    """Identify leg V2 from the lab's recordings on three rigs, and judge it on all of them."""

    out: Path = Path("legv2-identified.toml")
    """Robot file to write."""
    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, write the robot file, and return every number."""
        found = identify(recordings_folder(self.recordings))
        if found["worse"]:
            raise PhysicsError(f"{' '.join(found['worse'])} No robot file was written.")
        tree = robot_tree(found)
        robot_from_tree(tree, str(self.out))
        comment = _COMMENT.format(names=",\n".join(found["recordings"]))
        write_atomically(self.out, robot_text(tree, comment).encode())
        return found


if __name__ == "__main__":
    raise SystemExit(main("identification.real_leg", RealLeg))
