"""Hops in a run: flights, apexes, sink, skipped hops, body contact.

An apex is a maximum of the base height with the foot at least 3 mm clear of the ground; every one
counts.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray

CLEAR = 0.003
"""Foot clearance that counts as flight, m."""


@dataclass(frozen=True)
class Hops:
    """Hops of one run.

    Attributes:
        tick: Index of each apex, (hops,).
        apex: Base height at each apex, m, (hops,).
        in_flight: Whether the foot is clear of the ground, (ticks,).
    """

    tick: IntArray
    apex: Array
    in_flight: BoolArray


def at_apex(rate_before: Array, rate: Array, clearance: Array) -> BoolArray:
    """Tell which legs have just passed an apex in flight.

    Args:
        rate_before: Base velocity one tick ago, m/s, (...).
        rate: Base velocity now, m/s, (...).
        clearance: Foot clearance now, m, (...).
    """
    return (rate_before > 0) & (rate <= 0) & (clearance >= CLEAR)


def find_hops(height: Array, rate: Array, clearance: Array) -> Hops:
    """Find every in-flight apex of a run.

    Args:
        height: Base height, m, (ticks,).
        rate: Base velocity, m/s, (ticks,).
        clearance: Foot clearance, m, (ticks,).
    """
    passed = at_apex(rate[:-1], rate[1:], clearance[1:])
    tick = np.flatnonzero(passed) + 1
    apex = np.maximum(height[tick], height[tick - 1])
    return Hops(tick, apex, clearance >= CLEAR)
