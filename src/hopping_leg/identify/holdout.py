"""What is held out: stretches of recordings that no fit sees, spread over what was recorded."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import Recording

SHARE = 4
"""One stretch in so many is held out."""

STRETCH = 5.0
"""Usual length of a stretch, s."""

SHORTEST = 1.0
"""A stretch below this, s, judges nothing."""


def duration(recording: Recording) -> float:
    """Return how long a recording is, s."""
    return float(recording.time[-1] - recording.time[0]) + recording.metadata.period


def hold_out(
    recordings: Sequence[Recording], window: float, rng: np.random.Generator
) -> tuple[list[Recording], list[Recording]]:
    """Split recordings into what is fitted and what judges the fit.

    Each is cut into stretches of equal length, of which every fourth is held out, so that each
    part of an excitation stands on both sides. A short recording gives its last quarter.

    Args:
        recordings: To split.
        window: Shortest stretch that can be fitted, s.
        rng: Decides where the counting begins.

    Raises:
        RecordingError: A recording is too short to be split.
    """
    fit: list[Recording] = []
    held: list[Recording] = []
    for recording in recordings:
        whole = duration(recording)
        least = max(SHARE * SHORTEST, window * SHARE / (SHARE - 1) + 2 * recording.metadata.period)
        if whole < least:
            raise RecordingError(
                f"{recording.name} is too short: {whole:.3g} s, but {least:.3g} s are needed to"
                " fit to one part and to judge by another; record longer, or name recordings to"
                " judge by with --validate."
            )
        count = max(SHARE, int(whole / max(STRETCH, 1.25 * window)))
        begin = int(rng.integers(SHARE)) if count >= 2 * SHARE else SHARE - 1
        edges = np.linspace(0, len(recording), count + 1).round().astype(int)
        chosen = [i for i in range(count) if i % SHARE == begin]
        held += [part(recording, edges[i], edges[i + 1]) for i in chosen]
        for first, last in zip([-1, *chosen], [*chosen, count], strict=True):
            if edges[last] - edges[first + 1] >= round(window * recording.metadata.rate_hz) + 2:
                fit.append(part(recording, edges[first + 1], edges[last]))
    return fit, held


def part(recording: Recording, start: int, stop: int) -> Recording:
    """Return rows of a recording as a recording whose name says which seconds they are."""
    table = recording.trace.table[int(start) : int(stop)]
    first, last = (float(recording.time[row]) - recording.time[0] for row in (start, stop - 1))
    return dataclasses.replace(
        recording,
        trace=dataclasses.replace(recording.trace, table=table),
        name=f"{recording.name}, {first:.1f}-{last:.1f} s",
    )
