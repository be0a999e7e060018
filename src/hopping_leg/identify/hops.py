"""Hops in a recording: where a leg flies, and what tells of what.

A window that begins at rest and goes on until the base has left the ground tells of contact, masses
and transmission; one within a flight tells of the joints alone. Nothing else of such a recording is
simulated: from a touchdown on, what follows depends on the moment of the touchdown. Where nobody
measured the base, the joints tell when its foot was off the ground, and that how fast it took off.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.initial_states import base_rate, full_states
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import GRAVITY, Robot, dynamics, kinematics

_HALF = 0.035  # s to either side over which the base's course is a parabola
_JOINTS_HALF = 0.005  # s to either side over which the joints' speeds and torques are parabolas
_PUSH = 0.03  # s before lift-off in which the foot is still pushed and the leg stretches fastest
_LATE = 2.0  # times that a flight may last longer than the speed at lift-off says, e.g. downhill
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


def timed(recordings: Sequence[Recording]) -> bool:
    """Return whether only the time in the air tells how high a leg hopped in one of them."""
    return any(by_hops(r) and np.isnan(base_height(r)).any() for r in recordings)


def by_hops(recording: Recording) -> bool:
    """Return whether nothing but its hops is simulated of a recording; see ``with_height``."""
    rises = recording.has_column("base_rise_m") and not recording.has_column("height_m")
    return recording.metadata.rig == "boom" or (recording.metadata.rig == "rail" and rises)


def with_height(recording: Recording, robot: Robot) -> Recording:
    """Return a recording with the base's rise as its hops tell it, if nobody measured the height.

    A flight is a parabola between two moments at which the foot just stands on the ground. Besides,
    the rise is known where the leg rests, and NaN else.
    """
    known = ("height_m",) if recording.metadata.rig == "rail" else ("height_m", "base_rise_m")
    if recording.metadata.rig == "fixed-base" or any(map(recording.has_column, known)):
        return recording
    time, (position, velocity), flies = recording.time, full_states(recording), False
    standing = kinematics.stance_height(robot, position)
    rise = np.where(np.abs(velocity).max(axis=1) < _REST, standing, np.nan)
    stretches = kinematics.foot_velocity(robot, position, velocity)[:, 0]
    acceleration, (_, gravity) = _told_acceleration(recording, robot), _falling(recording, robot)
    falls, loaded = np.flatnonzero(acceleration < -gravity / 2), np.cumsum(acceleration > gravity)
    for aloft in np.split(falls, np.flatnonzero(np.diff(loaded[falls])) + 1):
        up, down = (aloft[0], aloft[-1]) if len(aloft) else (0, 0)
        push = slice(max(up - round(_PUSH * recording.metadata.rate_hz), 0), up + 1)
        pushed = acceleration[push].max() > gravity / 2 and down + 1 < len(time)
        longest = _LATE * 2 * stretches[push].max() / gravity
        if pushed and _SHORTEST < time[down] - time[up] < longest:
            since, left = time[up : down + 1] - time[up], time[down] - time[up : down + 1]
            chord = (standing[up] * left + standing[down] * since) / (since + left)
            rise[up : down + 1], flies = chord + gravity / 2 * since * left, True
    table = recording.trace.table.drop("base_rise_m", strict=False)
    return recording.with_table(table.with_columns(base_rise_m=rise) if flies else table)


def base_course(recording: Recording, robot: Robot) -> tuple[Array, Array]:
    """Return the base's velocity, m/s, and acceleration, m/s2, by parabolas in time, (rows,).

    Where its height is unknown the foot stands on the ground.
    """
    height, standing = base_height(recording), recording.array("position")
    height = np.where(np.isnan(height), kinematics.stance_height(robot, standing), height)
    course = _parabolas(recording, height[:, None], _HALF)[..., 0]
    return course[:, 1], 2 * course[:, 2]


def _parabolas(recording: Recording, values: Array, half: float) -> Array:
    """Return coefficients of parabolas in time around every row, (rows, 3, columns)."""
    time, half = recording.time, max(2, round(half * recording.metadata.rate_hz))
    if len(time) < 2 * half + 1:
        return np.zeros((len(time), 3, values.shape[1]))
    first = np.clip(np.arange(len(time)) - half, 0, len(time) - 2 * half - 1)
    rows = first[:, None] + np.arange(2 * half + 1)
    t = (time[rows] - time[:, None])[..., None] ** np.arange(3)
    return np.asarray(np.linalg.pinv(t) @ values[rows])


def _falling(recording: Recording, robot: Robot) -> tuple[float, float]:
    """Return the mass at the base, kg, and how fast it falls freely, m/s2, on its rig."""
    boom, leg = recording.metadata.boom, robot.mass - recording.metadata.boom.slider
    mass = leg + boom.inertia + boom.mass
    return mass, (GRAVITY * (leg + boom.moment) + boom.weight) / mass


@np.errstate(divide="ignore", invalid="ignore")
def _told_acceleration(recording: Recording, robot: Robot) -> Array:
    """Return the base's acceleration that joints and their torques tell, m/s2, (rows,), or NaN.

    In M p'' + b = (0, tau) + J' F it is one of three unknowns, beside the force F on the foot.
    """
    (q, qd), torque = full_states(recording), recording.array("torque")
    lasted = np.diff(recording.time, prepend=recording.time[0])[:, None]
    course = np.concatenate([qd, np.cumsum(lasted * torque, axis=0)], axis=1)
    qdd, torque = np.split(_parabolas(recording, course, _JOINTS_HALF)[:, 1], 2, axis=1)
    matrix, bias = dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, qd)
    jacobian, (mass, gravity) = kinematics.jacobian(robot, q), _falling(recording, robot)
    inner = np.vecdot(matrix[:, 0, 1:], qdd) + bias[:, 0] + mass * gravity - robot.mass * GRAVITY
    free = torque - np.einsum("nij,nj->ni", matrix[:, 1:, 1:], qdd) - bias[:, 1:]
    lever = jacobian[:, 1, ::-1] * [1.0, -1.0] / np.linalg.det(jacobian)[:, None]
    told: Array = (np.vecdot(lever, free) - inner) / (mass + np.vecdot(lever, matrix[:, 1:, 0]))
    return told


def flights(recording: Recording, robot: Robot) -> list[Flight]:
    """Return the flights of a leg, in which its base falls by more than half of its gravity."""
    drops = base_course(recording, robot)[1] < -_falling(recording, robot)[1] / 2
    falls = np.flatnonzero(drops & ~np.isnan(base_height(recording)))
    apart = np.flatnonzero(np.diff(falls) > 1 + _GAP * recording.metadata.rate_hz) + 1
    time, resting = recording.time, np.abs(recording.array("velocity")).max(axis=1) < _REST
    found = []
    for aloft in np.split(falls, apart) if len(falls) else ():
        start, stop = int(aloft[0]), int(aloft[-1]) + 1
        rows = np.flatnonzero(resting[:start] & (time[:start] > time[start] - _LONGEST_PUSH))
        if time[stop - 1] - time[start] >= _SHORTEST:
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

    Where none was measured, the leg stands: its height is left open, NaN, and its rate zero.
    """
    if not by_hops(recording) and recording.has_column("height_m"):
        return base_height(recording), base_rate(recording, robot)
    measured, (velocity, _) = base_height(recording), base_course(recording, robot)
    height, rate = np.full(len(recording), np.nan), np.zeros(len(recording))
    standing = kinematics.stance_height(robot, recording.array("position"))
    back = round(_SHORTEST * recording.metadata.rate_hz)
    for flight in flights(recording, robot):
        stands = max(flight.start - back, 0) if flight.rest is None else flight.rest
        ground = np.nan_to_num(measured[stands] - standing[stands])
        rows = slice(flight.start, flight.stop)
        height[rows], rate[rows] = measured[rows] - ground, velocity[rows]
    return height, rate
