"""Real recordings: each in turn is held out while the others are fitted with the default plan."""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import robot_of
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.identify.result import validation_json
from hopping_leg.robot import load_robot
from studies.identification.study import Clock, FitCache, Study

RIGS = {
    "double pendulum": "doublependulum_fixed_base",
    "leg V2, fixed base": "legv2_fixed_base",
}
"""Folder of each rig's recordings."""


def real(study: Study, cache: FitCache, folder: Path) -> dict[str, Any]:
    """Identify every leave-one-out split of every rig.

    Args:
        study: Threads and seed.
        cache: Keeps each split's result.
        folder: With the folders of ``RIGS``.

    Returns:
        ``rows``, a record per split: what was held out and the errors on it, (hip, knee).

    Raises:
        UsageError: The folder holds none of the rigs.
        RecordingError: A recording cannot be read.
    """
    rows = []
    for rig, name in RIGS.items():
        paths = sorted((folder / name).glob("*.csv.gz"))
        recordings = [load_recording(path) for path in paths]
        for held in recordings:
            fitted = [r for r in recordings if r is not held]
            if not fitted:
                continue
            short = f"real-{name}-without-{held.name.split('.')[0]}"
            asked = {"fitted": [r.digest for r in fitted], "held": held.digest, "seed": study.seed}
            row = cache.load_or_run(
                short,
                f"{rig}, judged by {held.name}",
                asked,
                functools.partial(_split, study, cache, fitted, held),
            )
            rows.append({"rig": rig, "held_out": held.name, **row})
    if not rows:
        known = " and ".join(RIGS.values())
        raise UsageError(f"{folder} has no two recordings in its folders {known}.")
    return {"rows": rows}


def _split(
    study: Study, cache: FitCache, fitted: Sequence[Recording], held: Recording
) -> dict[str, Any]:
    with Clock() as clock:
        identified = identify(
            fitted,
            load_robot(robot_of(fitted)),
            validate=[held],
            options=IdentifyOptions(threads=study.threads),
            seed=study.seed,
            report=cache.report,
        )
    after, before = (
        _flat(validation_json(v)) for v in (identified.validation, identified.start_validation)
    )
    return {
        **after,
        "before": before,
        "fitted": len(identified.identifiability.names),
        "candidates": sum(one.found.evaluations for one in identified.passes),
        "wall_s": clock.wall,
        "cpu_s": clock.cpu,
    }


def _flat(validation: dict[str, Any]) -> dict[str, Any]:
    """Return a validation with one entry per horizon; what does not exist is null."""
    ahead = validation.pop("open_loop_position_rms_rad")
    named = {f"predicted_{horizon.replace('.', '_')}_s_rms_rad": p for horizon, p in ahead.items()}
    return {
        name: [value if value == value else None for value in pair]
        for name, pair in {**validation, **named}.items()
    }
