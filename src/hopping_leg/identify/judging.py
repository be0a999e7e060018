"""A hypothesis judged on recordings of any length."""

import dataclasses
from collections.abc import Sequence

from hopping_leg.identify.holdout import duration
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.validation import HORIZONS, Validation, open_loop, validate

UNSCORED = 1.0
"""Beginning of a recording that does not count in closed loop, s, or a quarter of a short one."""


def judge(
    recordings: Sequence[Recording], hypothesis: LegHypothesis, timestep: float, threads: int = 0
) -> Validation:
    """Judge a hypothesis; a recording that is shorter than a horizon is left out there.

    Args:
        recordings: Best those that no fit has seen.
        hypothesis: What to judge.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.

    Raises:
        RecordingError: A recording is too short to judge anything.
    """
    closed = validate(
        recordings,
        hypothesis,
        timestep=timestep,
        threads=threads,
        unscored=unscored(recordings),
        horizons=(),
    )
    predicted = {}
    for horizon in HORIZONS:
        long_enough = [r for r in recordings if _reaches(r, horizon)]
        predicted[horizon] = open_loop(long_enough, hypothesis, horizon, timestep, threads)
    return dataclasses.replace(closed, open_loop_position=predicted)


def unscored(recordings: Sequence[Recording]) -> float:
    """Return the beginning of each recording that does not count in closed loop, s."""
    return min(UNSCORED, 0.25 * min(map(duration, recordings)))


def _reaches(recording: Recording, horizon: float) -> bool:
    rows = max(s.stop - s.start for s in recording.segments())
    return bool(rows >= max(3, round(horizon * recording.metadata.rate_hz)))
