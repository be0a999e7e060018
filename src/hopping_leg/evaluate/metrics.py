"""What is measured of a run; every definition stands in docs/evaluation.md."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import motor_load
from hopping_leg.hop_detection import COLUMNS, measure_hops
from hopping_leg.trace import Trace

START_SECONDS = 2.0  # in which hops are dropped after the standing start
SWITCH_SECONDS = 1.0  # in which hops are dropped after a change of command


@dataclass(frozen=True)
class HopWindow:
    """One stretch of a run with a constant command.

    Apexes, skipped hops and flight are taken after the start (2 s) or switch (1 s) has settled.
    """

    command: float
    """Desired apex height, m."""
    apex: Array
    """Height of every in-flight apex, m, (hops,)."""
    standing: float
    """Base height in which the run began, m."""
    settled: float
    """Time in which apexes were counted, s."""
    flight: float
    """Time of ``settled`` in which the foot was clear of the ground, s."""
    skipped: int
    """Hops that should have happened and did not."""
    bounces: int
    """Bounces that never left the ground."""
    part: Trace
    """The stretch itself."""

    def contacts(self, part: str) -> int:
        """Count how often ``"base"`` or ``"knee"`` touched the ground, over the whole stretch."""
        return motor_load.events(self.part.column(f"{part}_clearance_m") <= 0)


def measure(trace: Trace) -> list[HopWindow]:
    """Measure a run: one window per stretch of constant command, in order of time."""
    rate = _rate(trace)
    return [
        _window(trace, start, end, rate, START_SECONDS if start == 0 else SWITCH_SECONDS)
        for start, end in stretches(trace.column("command_m"))
    ]


def stretches(command: Array) -> list[tuple[int, int]]:
    """Return first tick and one past the last of every stretch of constant command."""
    edges = [0, *(np.flatnonzero(np.diff(command)) + 1).tolist(), len(command)]
    return list(itertools.pairwise(edges))


def _window(trace: Trace, start: int, end: int, rate: float, drop: float) -> HopWindow:
    height, velocity, clearance = map(trace.column, COLUMNS)
    first = min(start + round(drop * rate), end)
    hops = measure_hops(height[:end], velocity[:end], clearance[:end], rate, first)
    return HopWindow(
        command=float(trace.column("command_m")[start]),
        apex=hops.apex,
        standing=float(height[0]),
        settled=hops.ticks / rate,
        flight=hops.flight_ticks / rate,
        skipped=hops.skipped,
        bounces=hops.bounces,
        part=Trace(trace.table[start:end], trace.header),
    )


def _rate(trace: Trace) -> float:
    """Return the control rate, Hz."""
    time = trace.column("time_s")
    return float((len(time) - 1) / (time[-1] - time[0]))


def skipped_in_run(trace: Trace) -> int:
    """Count skipped hops of a whole run after its start, switches of command included."""
    return _window(trace, 0, len(trace.table), _rate(trace), START_SECONDS).skipped


def errors_of(windows: Sequence[HopWindow]) -> list[Array]:
    """Return apex minus command of every window's hops, m, (hops,), misses where it has none.

    A run without a hop missed its command by the whole distance from where it stood. It counts as
    often as a run of its length has hops in the median of the others, at least once.
    """
    rates = [len(w.apex) / w.settled for w in windows if len(w.apex)]
    rate = float(np.median(rates)) if rates else 0.0
    missed = (np.full(max(1, round(rate * w.settled)), w.standing) for w in windows)
    pairs = zip(windows, missed, strict=True)
    return [(w.apex if len(w.apex) else instead) - w.command for w, instead in pairs]


def pooled_apexes(windows: Sequence[HopWindow]) -> Array:
    """Return the apexes of several windows in one row, m, (hops,)."""
    return np.concatenate([w.apex for w in windows]) if windows else np.empty(0)


ESTIMATED_APEX = "estimated_apex_m"
"""Trace column: height of the last apex as estimated after its flight, m."""
