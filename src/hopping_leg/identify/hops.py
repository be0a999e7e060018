"""Hops in a recording whose base was measured: where a leg flies, and what tells of what.

A window that begins at rest and goes on until the base has left the ground tells of contact, masses
and transmission; one within a flight tells of the joints alone. Nothing else of such a recording is
simulated: from a touchdown on, what follows depends on the moment of the touchdown.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import GRAVITY, Robot, kinematics

_HALF = 0.035  # s to either side over which the base's course is a parabola
_SHORTEST = 0.08  # of a flight, s
_AFTER, _BEFORE = 0.04, 0.04  # s at both ends of a flight that belong to lift-off and touchdown
_GAP = 0.03  # s that part no flights
_RISE = 0.1  # s of a flight whose course tells how fast the base took off
_REST = 0.3  # rad/s, below which a joint rests
_LONGEST_PUSH = 0.35  # s
_FLIGHT = 0.15  # s of a flight that are simulated from one measured state


@dataclass(frozen=True)
class Flight:
    """Rows of one recording."""

    rest: int | None
    """Last row before the push in which both joints rest, if they do."""
    start: int
    stop: int


def base_height(recording: Recording) -> Array:
    """Return the base's height above whatever zero was measured, m, (rows,), NaN if none was."""
    for name in ("height_m", "base_rise_m"):
        if recording.has_column(name):
            return recording.trace.column(name)
    return np.full(len(recording), np.nan)


def base_course(recording: Recording) -> tuple[Array, Array]:
    """Return the base's velocity, m/s, and acceleration, m/s2, by parabolas in time, (rows,)."""
    time, height = recording.time, base_height(recording)
    half = max(2, round(_HALF * recording.metadata.rate_hz))
    if len(time) < 2 * half + 1:
        return np.zeros(len(time)), np.zeros(len(time))
    first = np.clip(np.arange(len(time)) - half, 0, len(time) - 2 * half - 1)
    rows = first[:, None] + np.arange(2 * half + 1)
    t = (time[rows] - time[:, None])[..., None] ** np.arange(3)
    turned = t.swapaxes(1, 2)
    found = np.linalg.solve(turned @ t, turned @ height[rows][..., None])[..., 0]
    return found[:, 1], 2 * found[:, 2]


def flights(recording: Recording, robot: Robot) -> list[Flight]:
    """Return the flights of a leg, in which its base falls by more than half of its gravity."""
    boom = recording.metadata.boom
    leg = robot.mass - boom.slider
    gravity = (GRAVITY * (leg + boom.moment) + boom.weight) / (leg + boom.inertia + boom.mass)
    falls = np.flatnonzero(base_course(recording)[1] < -gravity / 2)
    apart = np.flatnonzero(np.diff(falls) > 1 + _GAP * recording.metadata.rate_hz) + 1
    time, resting = recording.time, np.abs(recording.array("velocity")).max(axis=1) < _REST
    found = []
    for aloft in np.split(falls, apart) if len(falls) else ():
        start, stop = int(aloft[0]), int(aloft[-1]) + 1
        if time[stop - 1] - time[start] < _SHORTEST:
            continue
        rows = np.flatnonzero(resting[:start] & (time[:start] > time[start] - _LONGEST_PUSH))
        found.append(Flight(int(rows[-1]) if len(rows) else None, start, stop))
    return found


def hop_windows(recording: Recording, robot: Robot) -> list[tuple[int, int, int]]:
    """Return the windows that a recording of hops is good for.

    Of each first row, length, and in how many rows joints count: torques move a leg in the air so
    easily that none tells where its joints are much later.
    """
    rate, time, windows = recording.metadata.rate_hz, recording.time, []
    length = max(3, round(_FLIGHT * rate))
    for flight in flights(recording, robot):
        if flight.rest is not None:
            begun = flight.start - flight.rest
            windows.append((flight.rest, begun + round(_RISE * rate), begun))
        first, last = flight.start + round(_AFTER * rate), flight.stop - round(_BEFORE * rate)
        windows += [(row, length, length) for row in range(first, last - length + 1, length)]
    stalls = np.diff(time) > 2 / rate
    return [w for w in windows if w[0] + w[1] <= len(time) and not stalls[w[0] : w[0] + w[1]].any()]


def start_heights(recording: Recording, robot: Robot) -> tuple[Array, Array]:
    """Return the hip's height above the ground that it left, m, and its rate, m/s, (rows,).

    Outside of flights the leg stands: its height is left open, NaN, and its rate zero.
    """
    measured, (velocity, _) = base_height(recording), base_course(recording)
    height, rate = np.full(len(recording), np.nan), np.zeros(len(recording))
    position = recording.array("position")
    back = round(_SHORTEST * recording.metadata.rate_hz)
    for flight in flights(recording, robot):
        stands = max(flight.start - back, 0) if flight.rest is None else flight.rest
        ground = measured[stands] - kinematics.stance_height(robot, position[stands])
        rows = slice(flight.start, flight.stop)
        height[rows], rate[rows] = measured[rows] - ground, velocity[rows]
    return height, rate
