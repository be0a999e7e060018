"""What an identification found: as JSON, and as a robot file."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify import optimizers, recording_format
from hopping_leg.identify.identifiability import Identifiability
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import FitPlan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.validation import Validation
from hopping_leg.io import parse_json, plain, replace_at, versions, write_atomically
from hopping_leg.robot import COARSE_TIMESTEP, JOINTS, Robot, load_tree, robot_from_tree, robot_text
from hopping_leg.robot.model_mismatch import NO_MISMATCH
from hopping_leg.robot.robot_checks import check_physics, numbers

_DELAY, _LATENCY = "drive.delay", "reality.latency.command"
_WORSE, _JOINT_WORSE = 1.01, 1.2  # Mean factor on errors that is worse, of both joints and of one
_FINE = {"rad": 1e-3, "N m": 0.02}  # Errors that are as good as none
PARAMETERS = ("parameter", "start", "identified", "95 % interval", "unit")
"""What is shown of each parameter."""
ERRORS = ("on held-out data, rms", "before: hip", "knee", "after: hip", "knee", "unit")
"""What is shown of each kind of error."""
_QUALITY = ("hip_before", "knee_before", "hip_after", "knee_after")
_SHARES = ("load_friction", "ramp")
LIBRARIES = ("hopping-leg", "mujoco", "numpy", "scipy", "cma", "polars")


@dataclass(frozen=True)
class Identified:
    """What came out."""

    hypothesis: LegHypothesis
    start: LegHypothesis
    """Robot and drives before the fit."""
    plan: FitPlan
    passes: tuple[optimizers.Pass, ...]
    """Searches in order; the last one's end is the result."""
    identifiability: Identifiability
    fit: tuple[Recording, ...]
    held: tuple[Recording, ...]
    """Recordings, or parts of them, that judge; the fit has not seen them."""
    split: str
    """``held-out stretches`` or ``validation recordings``."""
    validation: Validation
    """Errors of the result on what was held."""
    start_validation: Validation
    by_rig: Mapping[recording_format.Rig, Validation]
    """Errors of the result on each rig, if there are several."""
    seed: int

    @property
    def robot(self) -> Robot:
        """The robot with the identified values."""
        return self.hypothesis.robot

    def posterior(self, count: int, seed: int = 0) -> Array:
        """Draw values of the fitted parameters that the data allow, SI, (count, k).

        Their quantiles are the intervals, as far as these lie within the bounds of the search,
        where draws beyond them end; what the data say nothing about is drawn from all between.
        """
        known, rng = self.identifiability, np.random.default_rng(seed)
        searched = self.passes[-1].parameters
        low, high = (searched.values(bound) for bound in searched.bounds)
        deviation = np.maximum(np.sqrt(np.diag(known.covariance)), 1e-300)
        tied = known.covariance / np.outer(deviation, deviation)  # in units alike, for accuracy
        normal = rng.multivariate_normal(np.zeros(len(tied)), tied, count, method="eigh")
        drawn, anything = known.values + deviation * normal, rng.uniform(low, high, normal.shape)
        told = np.isfinite(known.half_width)
        return np.asarray(np.clip(np.where(told, drawn, anything), low, high))


def as_json(identified: Identified, posterior: int = 0) -> dict[str, Any]:
    """Return every number of an identification as JSON values; what does not exist is null.

    So many values of all parameters are drawn from the posterior; 0 leaves it out.
    """
    known, plan = identified.identifiability, identified.plan
    tree = {
        "robot": identified.start.robot.name,
        "robot_digest_before": identified.start.robot.digest,
        "robot_digest": identified.robot.digest,
        "validation": asdict(identified.validation),
        "start_validation": asdict(identified.start_validation),
        "validation_by_rig": {rig: asdict(v) for rig, v in identified.by_rig.items()},
        "quality": quality_json(identified),
        "warning": warning(identified),
        "parameters": parameters_json(identified),
        "correlations": {"names": known.names, "matrix": known.correlation.tolist()},
        "cannot_tell": known.statements,
        "search": {
            "method": plan.search,
            "scoring": asdict(plan.scoring),
            "window_s": plan.window,
            "unscored_s": plan.unscored,
            "timestep_s": COARSE_TIMESTEP,
            "passes": [
                {
                    "name": one.name,
                    "parameters": one.parameters.names,
                    "cost": one.found.cost,
                    "candidates": one.found.evaluations,
                    "history": one.found.history,
                }
                for one in identified.passes
            ],
        },
        "recordings": [
            {
                "name": recording.name,
                "use": use,
                "sha256": recording.digest,
                "rows": len(recording),
                "first_s": float(recording.time[0]),
                "last_s": float(recording.time[-1]),
                "rig": recording.metadata.rig,
                "rate_hz": recording.metadata.rate_hz,
                "source": recording.metadata.source,
                "warnings": list(recording.warnings),
            }
            for use, recordings in (("fit", identified.fit), ("judge", identified.held))
            for recording in recordings
        ],
        "split": identified.split,
        "seed": identified.seed,
        "versions": versions(*LIBRARIES),
    }
    if posterior:
        tree["posterior"] = {
            "names": known.names,
            "units": [p.unit for p in identified.passes[-1].parameters.parameters],
            "samples": identified.posterior(posterior, identified.seed).tolist(),
        }
    return dict(plain(tree))


def quality_json(identified: Identified) -> list[dict[str, Any]]:
    """Return a record per kind of error on held-out data, rms before and after the fit, SI.

    Errors of which these recordings tell nothing are left out.
    """
    judged = [identified.start_validation, identified.validation]
    errors = {
        ("position, closed loop", "rad"): [v.closed_loop_position_rms_rad for v in judged],
        ("torque, closed loop", "N m"): [v.closed_loop_torque_rms_nm for v in judged],
    }
    for horizon in identified.validation.open_loop_position_rms_rad:
        name = f"position, predicted {float(horizon):g} s ahead"
        errors[name, "rad"] = [v.open_loop_position_rms_rad[horizon] for v in judged]
    return [
        {"error": name, "unit": unit, **dict(zip(_QUALITY, (*before, *after), strict=True))}
        for (name, unit), (before, after) in errors.items()
        if np.isfinite([before, after]).any()
    ]


def warning(identified: Identified) -> str:
    """Return a sentence if the fit errs more than its start on held-out data, else ""."""
    rows, worse = quality_json(identified), dict[str, float]()
    for joint in JOINTS:
        pairs = [
            [max(row[f"{joint}_{time}"], _FINE[row["unit"]]) for time in ("before", "after")]
            for row in rows
        ]
        logs = [math.log(after / before) for before, after in pairs if after / before > 0]
        worse[joint] = math.exp(sum(logs) / max(len(logs), 1))
    joint = max(worse, key=worse.__getitem__)
    if worse[joint] < _JOINT_WORSE and math.prod(worse.values()) < _WORSE ** len(worse):
        return ""
    return (
        f"On data that it has not seen this fit errs {worse[joint]:.3g} times as much, {joint}, as"
        " what it began with: do not use it; keep that if it errs little, or check signs, units and"
        " gains of the recordings, whose links they are and what else moves them, or fit less."
    )


def verdict(identified: Identified) -> str:
    """Return how far each joint is off on held-out data, predicted from torques if these tell."""
    if not (shown := shown_errors(identified)):
        return "No data that it has not seen tell how good this fit is: give some, --validate."
    error, *errors, unit = max(shown, key=lambda row: "predicted" in row[0])
    said = (f"{j} {errors[i + 2]} {unit} ({errors[i]} before)" for i, j in enumerate(JOINTS))
    return f"On data that it has not seen, {error}, rms: {', '.join(said)}."


def at_bounds(identified: Identified) -> str:
    """Return a sentence that names the values that a bound of the search held, if any, else ""."""
    rows = (row for row in parameters_json(identified) if row["at_bound"])
    held = ", ".join(f"{row['name']} {row['value']:.4g} {row['unit']}" for row in rows)
    return f"AT A BOUND OF THE SEARCH: {held}. Widen it (--bounds) or leave it out." if held else ""


def parameters_json(identified: Identified) -> list[dict[str, Any]]:
    """Return a record per parameter: value, 95 % interval, start and bounds, SI.

    Intervals end where what is possible does: most numbers at zero, shares at one, too.
    """
    known = identified.identifiability
    first = {p.name: p.start for p in identified.plan.parameters.parameters}
    values, halves = known.values.tolist(), known.half_width.tolist()
    parameters = identified.passes[-1].parameters.parameters
    return [
        {
            "name": p.name,
            "unit": p.unit,
            "value": value,
            "interval_low": max(value - half, 0.0 if p.low >= 0 else -math.inf),
            "interval_high": min(value + half, 1.0)
            if math.isfinite(half) and p.name.endswith(_SHARES)
            else value + half,
            "scale": p.scale,
            "start": first.get(p.name, identified.start.get(p.name)),
            "bound_low": p.low,
            "bound_high": p.high,
            "at_bound": bool(stuck),
        }
        for p, value, half, stuck in zip(parameters, values, halves, known.at_bound, strict=True)
    ]


def shown_parameters(identified: Identified) -> list[tuple[str, ...]]:
    """Return a row of texts per parameter, in the columns of ``PARAMETERS``."""
    return [
        (
            row["name"],
            f"{row['start']:.4g}",
            f"{row['value']:.4g}{' (at bound)' if row['at_bound'] else ''}",
            f"{row['interval_low']:.4g} .. {row['interval_high']:.4g}"
            if math.isfinite(row["interval_high"])
            else "unknown",
            row["unit"],
        )
        for row in parameters_json(identified)
    ]


def shown_errors(identified: Identified) -> list[tuple[str, ...]]:
    """Return a row of texts per kind of error, in the columns of ``ERRORS``."""
    rows = []
    for row in quality_json(identified):
        unit, factor = ("mrad", 1e3) if row["unit"] == "rad" else (row["unit"], 1.0)
        values = [factor * row[key] for key in _QUALITY]
        shown = (f"{value:.3g}" if math.isfinite(value) else "-" for value in values)
        rows.append((row["error"], *shown, unit))
    return rows


def save_robot(identified: Identified, path: Path, origin: str | Path) -> None:
    """Write the robot file; it stands alone, and an existing file is replaced as a whole.

    The delay of the recordings' loop becomes the robot's latency, with which training simulates it.
    The stem of the ``.toml`` file is the robot's name; ``origin``, name or path of the robot that
    the fit began with, gives all other numbers. RobotError says that the identified values make no
    valid robot, TraceError that the file cannot be written; then nothing is.
    """
    stated = load_tree(origin)
    tree = {key: value for key, value in stated.items() if key != "reality"}
    for name, entry in numbers(stated.get("reality", {}), "reality."):
        if identified.start.get(name) == entry["value"]:  # a transmission that the fit began with
            tree = replace_at(tree, name, entry)
    tree["name"] = path.stem
    tree["description"] = f"{identified.start.robot.name}, identified from recordings"
    for row in parameters_json(identified):
        delays = row["name"] == _DELAY
        if not row["name"].startswith(("drive.", "boom.")) or (delays and row["value"] > 0):
            entry = {"value": row["value"], "unit": row["unit"], "source": _source(row)}
            tree = replace_at(tree, _LATENCY if delays else row["name"], entry)
    robot_from_tree(tree, str(path))
    write_atomically(path, robot_text(tree, _comment(identified, str(origin))).encode())


def posterior_robots(path: Path, robot: Robot) -> tuple[Robot, ...]:
    """Return what an identification's draws, stored as JSON, make of the robot that it wrote.

    UsageError says that the file is none such, has no draws or is of another robot, RobotError that
    a draw contradicts the robot.
    """
    tree, robots = parse_json(path.read_bytes(), str(path)), list[Robot]()
    reality = replace(robot.reality, latency=NO_MISMATCH.latency)
    if not replace(robot, reality=reality).has_digest(tree.get("robot_digest", "")):
        raise UsageError(f"{path} is not of {robot.name}; give --robot what `hop identify` wrote.")
    try:
        for row in tree["posterior"]["samples"]:
            drawn = dict(zip(tree["posterior"]["names"], row, strict=True))
            own = {n: v for n, v in drawn.items() if not n.startswith("drive.")}
            own |= {_LATENCY: drawn[_DELAY]} if _DELAY in drawn else {}
            robots.append(LegHypothesis(robot).replace(own).robot)
            check_physics(robots[-1], f"{path}: draw {len(robots)}")
        return (robots[0], *robots[1:])
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        sentence = f"{path} has no whole draws; make some: `hop identify --posterior 100`."
        raise UsageError(sentence) from error


def provenance(identified: Identified) -> list[str]:
    """Return what an identification was made from, by what, a line each."""
    lines = [
        f"{use}: {recording.name}, sha256 {recording.digest or 'unknown'}"
        for use, some in (("Fitted to", identified.fit), ("Judged by", identified.held))
        for recording in some
    ]
    libraries = ", ".join(f"{name} {value}" for name, value in versions(*LIBRARIES).items())
    how = f"{identified.plan.search}, {identified.split}, seed {identified.seed}"
    return [*lines, f"{how}; {libraries}."]


def _comment(identified: Identified, origin: str) -> str:
    """Return what stands above the tables: provenance, quality, and the drives' numbers."""
    numbers = [r for r in parameters_json(identified) if r["name"] != _DELAY]
    drives = [r for r in numbers if r["name"].startswith("drive.")]
    lines = [
        warning(identified),
        at_bounds(identified),
        f"Identified by `hop identify` from {origin}; numbers without 'identified' are its.",
        *provenance(identified),
        *(", ".join(row) for row in (ERRORS, *shown_errors(identified))),
        *(f"  {r['name']} = {r['value']:.6g} {r['unit']} ({_source(r)})" for r in drives),
        *identified.identifiability.statements,
    ]
    return "\n".join(filter(None, lines))


def _source(row: dict[str, Any]) -> str:
    low, high, unit = row["interval_low"], row["interval_high"], row["unit"]
    at_bound = "; at a bound of its search" if row["at_bound"] else ""
    if not math.isfinite(high - low):
        return f"identified, but these data say nothing about it; start {row['start']:.6g}"
    return f"identified: 95 % {low:.6g} to {high:.6g} {unit}, start {row['start']:.6g}{at_bound}"
