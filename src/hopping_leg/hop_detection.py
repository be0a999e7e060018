"""Hops in a run: flights, apexes, bounces that never left the ground, skipped hops.

A flight is a stretch of time with the foot at least 3 mm clear of the ground, an apex a maximum of
the base height in it. A hop is a flight with an apex; the highest of several is that of the hop.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.trace import Trace

COLUMNS = ("height_m", "height_rate_m_s", "foot_clearance_m")
"""Columns of a trace that hops are found in, in the order of ``find_hops``."""

FLIGHT_CLEARANCE = 0.003  # Foot clearance that counts as flight, m
BOUNCE = 0.01  # Rise and fall of a base whose foot stays on the ground that counts as a bounce, m
SKIP_RATIO = 1.6  # A gap between apexes of more median periods holds a skipped hop
USUAL_PERIOD = 0.5  # Period assumed where a run has less than three hops, s


@dataclass(frozen=True)
class HopMeasurement:
    """What a stretch of a run tells: its hops' apexes, m, (hops,), and hops that were skipped."""

    apex: Array
    ticks: int
    flight_ticks: int
    skipped: int
    bounces: int


@dataclass(frozen=True)
class Hops:
    """Ticks and heights, m, of one run's apexes, (hops,), and where it flies, (ticks,)."""

    tick: IntArray
    apex: Array
    in_flight: BoolArray


def at_apex(rose: BoolArray, rises: BoolArray, clearance: Array) -> BoolArray:
    """Return where a leg in flight that rose a tick ago rises no more, (...)."""
    return (rose > rises) & (clearance >= FLIGHT_CLEARANCE)


def find_hops(height: Array, velocity: Array, clearance: Array) -> Hops:
    """Find the hops of a run, one per flight; heights in m, velocity in m/s, (ticks,) each."""
    rises, flying = velocity > 0, clearance >= FLIGHT_CLEARANCE
    tick = np.flatnonzero(at_apex(rises[:-1], rises[1:], clearance[1:])) + 1
    apex = np.maximum(height[tick], height[tick - 1])
    flight = np.cumsum(flying & ~np.concatenate([[False], flying[:-1]]))[tick]
    highest = np.lexsort((-apex, flight))
    highest = highest[np.diff(flight[highest], prepend=-1) > 0]
    return Hops(tick[highest], apex[highest], flying)


def trace_hops(trace: Trace) -> Hops:
    """Find the hops of a trace, one per flight."""
    return find_hops(*map(trace.column, COLUMNS))


def measure_hops(
    height: Array, velocity: Array, clearance: Array, rate: float, first: int = 0
) -> HopMeasurement:
    """Measure the hops of a run from the tick ``first`` on, arguments as for ``find_hops``."""
    hops = find_hops(height, velocity, clearance)
    counted = hops.tick >= first
    bounces = find_bounces(height, clearance)
    bounces = bounces[bounces >= first]
    return HopMeasurement(
        hops.apex[counted],
        len(height) - first,
        int(hops.in_flight[first:].sum()),
        count_skipped(hops.tick[counted], bounces, first, len(height), rate),
        len(bounces),
    )


def find_bounces(height: Array, clearance: Array) -> IntArray:
    """Find maxima, ``BOUNCE`` high, of the base height on the ground: hops that never took off."""
    from scipy.signal import find_peaks  # takes a second, which no other part of the package needs

    peaks, _ = find_peaks(height, prominence=BOUNCE)
    aloft: IntArray = peaks[clearance[peaks] < FLIGHT_CLEARANCE]
    return aloft


def count_skipped(
    apex_tick: IntArray, bounce_tick: IntArray, start: int, end: int, rate: float
) -> int:
    """Count hops that should have happened between two ticks and did not.

    The apexes cut the window into gaps. A gap longer than
    ``SKIP_RATIO`` median periods misses ``round(gap / period) - 1`` apexes between two apexes and
    ``floor(gap / period)`` at the ends of the window; a bounce misses one. Each gap counts the
    larger of the two, so that a bounce in a long gap is one skipped hop, not two.

    Indices of apexes rise; ``end`` is one past the last tick of the window.
    """
    period = np.median(np.diff(apex_tick)) if len(apex_tick) > 2 else USUAL_PERIOD * rate
    edges = np.concatenate([[start], apex_tick, [end]])
    periods = np.diff(edges) / period
    apexes = np.round(periods) - 1
    apexes[[0, -1]] = np.floor(periods[[0, -1]])
    missed = np.where(periods > SKIP_RATIO, apexes, 0)
    bounces = np.histogram(bounce_tick, bins=edges)[0] if end > start else np.zeros(len(periods))
    return int(np.maximum(missed, bounces).sum())
