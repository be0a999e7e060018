"""The state in which a simulated window starts: measured, and smoothed where sensors are noisy.

A clamped leg moves without impacts, so over some 40 ms the cubic in time that fits positions and
velocities best is nearer to the true state than one noisy row. Each sensor weighs by its own
noise: what a cubic through that sensor alone leaves over.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

_REACH = 0.02
"""Time to either side of a row that its cubic spans, s."""

_LEAST_ROWS = 5
"""To either side, below which a cubic smooths nothing."""

_NOISY = 0.02
"""Noise of a velocity below which it is taken as measured, rad/s."""


def start_states(recording: Recording) -> tuple[Array, Array]:
    """Return joint position and velocity at every row to start a simulation from, (rows, 2) each.

    Rows up to 20 ms to either side have a say in it where a clamped leg's velocities are noisy.

    Raises:
        RecordingError: A joint has no measured position at all.
    """
    position, velocity = full_states(recording)
    if recording.metadata.rig != "fixed-base":
        return position, velocity
    for joint in range(2):
        measured = np.stack([recording.array(n)[:, joint] for n in ("position", "velocity")])
        if np.isnan(measured).any():
            continue
        for rows in recording.segments():
            smooth = _smoothed(recording.time[rows], *measured[:, rows])
            position[rows, joint], velocity[rows, joint] = smooth
    return position, velocity


def base_rate(recording: Recording, robot: Robot) -> Array:
    """Return the speed of the base at every row, m/s, (rows,), from its measured height.

    A foot on the ground tells most of it: that much is known from the joints' velocities, and
    only how far the ground gives is left to differences. Three rows from the same side of
    touchdown and lift-off make a difference, where there are so many. Where both joints stand
    still to the last digit the leg has not begun to move.

    Args:
        recording: With the base's height.
        robot: Leg whose lengths say when the foot is on the ground.
    """
    time, height = recording.time, recording.trace.column("height_m")
    position, velocity = full_states(recording)
    clearance = kinematics.foot_clearance(robot, height, position)
    stands = clearance <= 0
    known = np.where(stands, kinematics.foot_velocity(robot, position, velocity)[:, 0], 0.0)
    course = np.where(stands, clearance, height)
    rate: Array = np.gradient(height, time)
    slope, middle = np.diff(course) / np.diff(time), np.gradient(course, time)
    alike = stands[1:] == stands[:-1]
    inner = np.flatnonzero(alike[1:] & alike[:-1]) + 1
    # a parabola's slope between two rows is the mean of its slopes there
    rate[inner - 1] = known[inner - 1] + 2 * slope[inner - 1] - middle[inner]
    rate[inner + 1] = known[inner + 1] + 2 * slope[inner] - middle[inner]
    rate[inner] = known[inner] + middle[inner]
    rate[(recording.array("velocity") == 0).all(axis=1)] = 0.0
    return rate


def full_states(recording: Recording) -> tuple[Array, Array]:
    """Return joint position and velocity at every row, (rows, 2) each, rad and rad/s.

    Measured where the row has them, else the estimate, else interpolated between measured rows;
    a velocity that was never measured is the position's slope. For initial states only.

    Raises:
        RecordingError: A joint has no measured position at all.
    """
    position = _filled(recording, "position", "position_estimate")
    if np.isnan(position).any():
        raise RecordingError(f"{recording.name} lacks a joint's positions; record both.")
    velocity = _filled(recording, "velocity", "velocity_estimate")
    slope = np.gradient(position, recording.time, axis=0)
    return position, np.where(np.isnan(velocity), slope, velocity)


def _smoothed(time: Array, position: Array, velocity: Array) -> tuple[Array, Array]:
    """Return a joint's smoothed position and velocity, (rows,) each."""
    half = int(_REACH / np.median(np.diff(time)) + 1e-6) if len(time) > 1 else 0
    if half < _LEAST_ROWS or len(time) < 4 * half:
        return position, velocity
    cubics = _Cubics(time, half)
    alone_q, _ = cubics.fit(position, velocity, (1.0, 0.0))
    _, alone_v = cubics.fit(position, velocity, (0.0, 1.0))
    noise_q, noise_v = float(np.std(position - alone_q)), float(np.std(velocity - alone_v))
    if noise_v < _NOISY:
        return position, velocity
    return cubics.fit(position, velocity, (1 / max(noise_q, 1e-6), 1 / noise_v))


class _Cubics:
    """Cubics in time around every row.

    Args:
        time: (rows,), s.
        half: Rows to either side.
    """

    def __init__(self, time: Array, half: int) -> None:
        count = 2 * half + 1
        first = np.clip(np.arange(len(time)) - half, 0, len(time) - count)
        self._rows = first[:, None] + np.arange(count)
        t = time[self._rows] - time[:, None]
        self._scale = float(np.abs(t).max())
        self._powers = (t / self._scale)[..., None] ** np.arange(4)
        self._slopes = np.zeros_like(self._powers)
        self._slopes[..., 1:] = self._powers[..., :-1] * np.arange(1, 4) / self._scale

    def fit(
        self, position: Array, velocity: Array, weights: tuple[float, float]
    ) -> tuple[Array, Array]:
        """Return the cubics' positions and velocities at their rows, (rows,) each."""
        parts = (self._powers * weights[0], self._slopes * weights[1])
        design = np.concatenate(parts, axis=1)
        values = (position[self._rows] * weights[0], velocity[self._rows] * weights[1])
        target = np.concatenate(values, axis=1)[..., None]
        turned = design.swapaxes(1, 2)
        normal = turned @ design
        if not weights[0]:
            normal[:, 0, 0] = 1.0
        found = np.linalg.solve(normal, turned @ target)
        return found[:, 0, 0], found[:, 1, 0] / self._scale


def _filled(recording: Recording, quantity: str, estimate: str) -> Array:
    """Return a measured quantity without gaps where that is possible, (ticks, 2)."""
    values = recording.array(quantity)
    values = np.where(np.isnan(values), recording.array(estimate), values)
    for joint in range(2):
        known = ~np.isnan(values[:, joint])
        if known.any():
            times = recording.time
            values[:, joint] = np.interp(times, times[known], values[known, joint])
    return values
