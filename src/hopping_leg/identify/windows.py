"""Windows to simulate from a measured state, and stretches of recordings that no fit sees."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify.recording import Recording


@dataclass(frozen=True)
class Window:
    """Rows ``start`` to ``start + length`` of a recording."""

    recording: int
    """Index of the recording."""
    start: int
    """First row, whose state starts the simulation."""
    length: int
    unscored: int = 1
    """Rows at the beginning that no residual counts, while the start's error decays."""


def cut(
    recordings: Sequence[Recording],
    duration: float | None = None,
    *,
    stride: float | None = None,
    unscored: float = 0.0,
) -> list[Window]:
    """Cut recordings into windows of one duration, s, whose first ``unscored`` s do not count.

    Without a duration each recording is one window, as in the paper. The stride, s, is from one
    window's start to the next; without it there is no gap and no overlap.

    Raises:
        UsageError: A duration has no meaning.
        RecordingError: A recording is shorter than one window.
    """
    for name, value in (("duration", duration), ("stride", stride)):
        if value is not None and not 0 < value < np.inf:
            raise UsageError(f"The windows' {name} is {value} s but must be positive and finite.")
    windows: list[Window] = []
    for index, recording in enumerate(recordings):
        rate = recording.metadata.rate_hz
        skip = max(1, round(unscored * rate))
        before = len(windows)
        for segment in recording.segments():
            rows = segment.stop - segment.start
            length = rows if duration is None else round(duration * rate)
            if length <= skip + 1:
                continue
            step = length if stride is None else max(1, round(stride * rate))
            starts = range(segment.start, segment.stop - length + 1, step)
            windows += [Window(index, start, length, skip) for start in starts]
        if len(windows) == before:
            wanted = f"windows of {duration:g} s" if duration else "one window"
            raise RecordingError(
                f"{recording.name} has {len(recording)} rows, {len(recording) / rate:.3g} s, too"
                f" short for {wanted} of which {skip / rate:.3g} s do not count; record longer."
            )
    return windows


def deal(
    windows: Sequence[Window], shares: int, rng: np.random.Generator
) -> list[tuple[Window, ...]]:
    """Deal windows to shares of nearly equal size, each of which is spread over all of them.

    Of so many windows in a row every share gets one, at random, lest a motion's period favour one.
    No share stays empty, so that there may be fewer.
    """
    count = min(shares, len(windows))
    rows = -(-len(windows) // count)
    owners = np.concatenate([rng.permutation(count) for _ in range(rows)])
    pairs = list(zip(windows, owners, strict=False))
    return [tuple(w for w, owner in pairs if owner == share) for share in range(count)]


_SHARE = 4  # one stretch in so many is held out
_STRETCH = 5.0  # usual length of a stretch, s
SHORTEST = 1.0
"""A stretch below this, s, judges nothing."""


def duration(recording: Recording) -> float:
    """Return how long a recording is, s."""
    return float(recording.time[-1] - recording.time[0]) + recording.metadata.period


def hold_out(
    recordings: Sequence[Recording], window: float, rng: np.random.Generator
) -> tuple[list[Recording], list[Recording]]:
    """Split recordings into what is fitted and what judges the fit.

    Every fourth of equal stretches is held out, counted from a random one; a short recording gives
    its last quarter. No stretch to fit is shorter than a window, s.

    Raises:
        RecordingError: A recording is too short to be split.
    """
    fit: list[Recording] = []
    held: list[Recording] = []
    for recording in recordings:
        whole, spare = duration(recording), 2 * recording.metadata.period
        least = max(_SHARE * SHORTEST, window * _SHARE / (_SHARE - 1) + spare)
        if whole < least:
            raise RecordingError(
                f"{recording.name} is too short: {whole:.3g} s, but {least:.3g} s are needed to"
                " fit to one part and to judge by another; record longer, or name recordings to"
                " judge by with --validate."
            )
        count = max(_SHARE, int(whole / max(_STRETCH, 1.25 * window)))
        begin = int(rng.integers(_SHARE)) if count >= 2 * _SHARE else _SHARE - 1
        edges = np.linspace(0, len(recording), count + 1).round().astype(int)
        chosen = [i for i in range(count) if i % _SHARE == begin]
        held += [part(recording, edges[i], edges[i + 1]) for i in chosen]
        for first, last in zip([-1, *chosen], [*chosen, count], strict=True):
            if edges[last] - edges[first + 1] >= round(window * recording.metadata.rate_hz) + 2:
                fit.append(part(recording, edges[first + 1], edges[last]))
    return fit, held


def part(recording: Recording, start: int, stop: int) -> Recording:
    """Return rows of a recording as a recording whose name says which seconds they are."""
    table = recording.trace.table[int(start) : int(stop)]
    first, last = (float(recording.time[row]) - recording.time[0] for row in (start, stop - 1))
    name = f"{recording.name}, {first:.1f}-{last:.1f} s"
    trace = replace(recording.trace, table=table)
    return replace(recording, trace=trace, name=name)
