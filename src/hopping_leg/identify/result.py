"""What an identification found, and all of it as JSON."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hopping_leg.identify.identifiability import Identifiability
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.optimizers import Pass
from hopping_leg.identify.parameters import ParameterSet
from hopping_leg.identify.plan import Plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.validation import Validation
from hopping_leg.io import plain, versions
from hopping_leg.robot.parameters import Robot

_LIBRARIES = ("hopping-leg", "mujoco", "numpy", "scipy", "cma", "polars")


@dataclass(frozen=True)
class Identified:
    """What came out.

    Attributes:
        hypothesis: Robot and drives with the identified values.
        start: Robot and drives before the fit.
        plan: All decisions.
        passes: Searches in order; the last one's end is the result.
        identifiability: Values, intervals, correlations, and what the data cannot tell.
        fit: Recordings, or parts of them, that were fitted.
        held: Recordings, or parts of them, that judge; the fit has not seen them.
        split: ``held-out stretches`` or ``validation recordings``.
        validation: Of the result on what was held.
        start_validation: Of the start, likewise.
        by_rig: Of the result on each rig, if there are several.
        seed: Of all randomness.
    """

    hypothesis: LegHypothesis
    start: LegHypothesis
    plan: Plan
    passes: tuple[Pass, ...]
    identifiability: Identifiability
    fit: tuple[Recording, ...]
    held: tuple[Recording, ...]
    split: str
    validation: Validation
    start_validation: Validation
    by_rig: Mapping[Rig, Validation]
    seed: int

    @property
    def robot(self) -> Robot:
        """The robot with the identified values."""
        return self.hypothesis.robot

    @property
    def parameters(self) -> ParameterSet:
        """What the last pass fitted, with its bounds."""
        return self.passes[-1].parameters


def as_json(identified: Identified) -> dict[str, Any]:
    """Return every number of an identification as JSON values; what does not exist is null."""
    known, plan = identified.identifiability, identified.plan
    tree = {
        "robot": identified.start.robot.name,
        "robot_digest_before": identified.start.robot.digest,
        "robot_digest": identified.robot.digest,
        "validation": validation_json(identified.validation),
        "start_validation": validation_json(identified.start_validation),
        "validation_by_rig": {r: validation_json(v) for r, v in identified.by_rig.items()},
        "quality": quality_json(identified),
        "parameters": parameters_json(identified),
        "correlations": {"names": known.names, "matrix": known.correlation.tolist()},
        "cannot_tell": known.statements,
        "search": {
            "method": plan.search,
            "scoring": dataclasses.asdict(plan.scoring),
            "window_s": plan.window,
            "stride_s": plan.stride,
            "unscored_s": plan.unscored,
            "timestep_s": plan.timestep,
            "passes": [_pass_json(p) for p in identified.passes],
        },
        "recordings": [
            *_recordings_json(identified.fit, "fit"),
            *_recordings_json(identified.held, "judge"),
        ],
        "split": identified.split,
        "seed": identified.seed,
        "versions": software_versions(),
    }
    described: dict[str, Any] = plain(tree)
    return described


def validation_json(validation: Validation) -> dict[str, Any]:
    """Return a validation under the names that other tools rely on, each value (hip, knee)."""
    return {
        "closed_loop_position_rms_rad": list(validation.closed_loop_position),
        "closed_loop_torque_rms_nm": list(validation.closed_loop_torque),
        "open_loop_position_rms_rad": {
            f"{horizon:.1f}": list(pair) for horizon, pair in validation.open_loop_position.items()
        },
    }


def quality_json(identified: Identified) -> list[dict[str, Any]]:
    """Return a record per kind of error on held-out data, rms before and after the fit, SI.

    Errors of which these recordings tell nothing are left out.
    """
    before, after = identified.start_validation, identified.validation
    rows = [
        ("position, closed loop", "rad", before.closed_loop_position, after.closed_loop_position),
        ("torque, closed loop", "N m", before.closed_loop_torque, after.closed_loop_torque),
    ]
    for horizon, pair in before.open_loop_position.items():
        name = f"position, predicted {horizon:g} s ahead"
        rows.append((name, "rad", pair, after.open_loop_position[horizon]))
    return [
        {
            "error": name,
            "unit": unit,
            "hip_before": first[0],
            "knee_before": first[1],
            "hip_after": second[0],
            "knee_after": second[1],
        }
        for name, unit, first, second in rows
        if any(map(math.isfinite, (*first, *second)))
    ]


def parameters_json(identified: Identified) -> list[dict[str, Any]]:
    """Return a record per parameter: value, 95 % interval, start and bounds, SI."""
    known = identified.identifiability
    bounds = {p.name: p for p in identified.parameters.parameters}
    first = {p.name: p.start for p in identified.plan.parameters.parameters}
    rows = []
    for index, name in enumerate(known.names):
        value, half = float(known.values[index]), float(known.half_width[index])
        rows.append(
            {
                "name": name,
                "unit": bounds[name].unit,
                "value": value,
                "interval_low": value - half,
                "interval_high": value + half,
                "start": first.get(name, identified.start.get(name)),
                "bound_low": bounds[name].low,
                "bound_high": bounds[name].high,
                "at_bound": bool(known.at_bound[index]),
            }
        )
    return rows


def software_versions() -> dict[str, str]:
    """Return the versions that the numbers may depend on."""
    return versions(*_LIBRARIES)


def _pass_json(one: Pass) -> dict[str, Any]:
    return {
        "name": one.name,
        "parameters": one.parameters.names,
        "cost": one.found.cost,
        "candidates": one.found.evaluations,
        "history": one.found.history,
        "other_starts": list(one.others),
    }


def _recordings_json(recordings: Iterable[Recording], use: str) -> Sequence[dict[str, Any]]:
    return [
        {
            "name": r.name,
            "use": use,
            "sha256": r.digest,
            "rows": len(r),
            "first_s": float(r.time[0]),
            "last_s": float(r.time[-1]),
            "rig": r.metadata.rig,
            "rate_hz": r.metadata.rate_hz,
            "source": r.metadata.source,
            "warnings": list(r.warnings),
        }
        for r in recordings
    ]
