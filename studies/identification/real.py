"""Real recordings: each in turn is held out while the others are fitted with the default plan."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from hopping_leg.errors import UsageError
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import robot_of
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.robot import load_robot
from studies.identification.study import Study, timed
from studies.shared import Row

RIGS = {
    "double pendulum": "doublependulum_fixed_base",
    "leg V2, fixed base": "legv2_fixed_base",
}
"""Folder of each rig's recordings."""
HALVES = "halves of leg V2"
"""Of its recordings first halves are fitted, too, and judged by each second half."""


def real(study: Study, folder: Path) -> Row:
    """Identify every leave-one-out split of every rig, and of halves.

    Args:
        study: Threads and seed.
        folder: With the folders of ``RIGS``.

    Returns:
        ``rows``, a record per split: what was held out and the errors on it, (hip, knee).

    Raises:
        UsageError: The folder holds none of the rigs.
        RecordingError: A recording cannot be read.
    """
    rows = []
    for rig, name in RIGS.items():
        recordings = [load_recording(path) for path in sorted((folder / name).glob("*.csv.gz"))]
        splits = [(rig, [r for r in recordings if r is not held], held) for held in recordings]
        if rig.startswith("leg V2"):  # without digests, as the judge's are of whole files
            first = [replace(r.part(0, len(r) // 2), digest="") for r in recordings]
            splits += [(HALVES, first, r.part(len(r) // 2, len(r))) for r in recordings]
        for kind, fitted, held in splits if len(recordings) > 1 else []:
            asked = {"held": held.digest, "fitted": [r.name for r in fitted], "seed": study.seed}
            asked["files"] = [r.digest for r in recordings]
            row = study.once(f"{kind}-without-{held.name}", asked, _split, fitted, held)
            rows.append({"rig": kind, "held_out": held.name, **row})
    if not rows:
        raise UsageError(f"{folder} has no two recordings in {' and '.join(RIGS.values())}.")
    return {"rows": rows}


def _split(study: Study, fitted: Sequence[Recording], held: Recording) -> Row:
    options = IdentifyOptions(threads=study.threads)
    robot = load_robot(robot_of(fitted))
    identified, took = timed(
        lambda: identify(fitted, robot, validate=[held], options=options, seed=study.seed)
    )
    known = identified.identifiability
    after, before = (_flat(asdict(v)) for v in (identified.validation, identified.start_validation))
    return {
        **after,
        "before": before,
        "fitted": len(identified.identifiability.names),
        "at_bound": [n for n, at in zip(known.names, known.at_bound, strict=True) if at],
        "candidates": sum(one.found.evaluations for one in identified.passes),
        **took,
    }


def _flat(validation: Row) -> Row:
    """Return a validation with one entry per horizon; what does not exist is null."""
    ahead = validation.pop("open_loop_position_rms_rad")
    named = {f"predicted_{horizon.replace('.', '_')}_s_rms_rad": p for horizon, p in ahead.items()}
    return {
        name: [value if value == value else None for value in pair]
        for name, pair in {**validation, **named}.items()
    }
