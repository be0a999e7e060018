"""The state in which a simulated window starts: measured, and smoothed where sensors are noisy.

A clamped leg moves without impacts, so over some 40 ms the cubic in time that fits positions and
velocities best is nearer to the true state than one noisy row. Each sensor weighs by its own
noise: what a cubic through that sensor alone leaves over.

Encoders that were zeroed with the leg at rest are off by as much as friction held it from hanging.
The offsets follow from the balance of momentum. With the Lagrangian L = T - V of the leg on a fixed
base, p = dT/dq' and the torque tau less friction f,

    p(t + h) - p(t) = integral of (dT/dq - dV/dq + tau - f) from t to t + h,

which needs velocities but no accelerations. Wrong offsets tilt gravity and bend the leg:
two numbers of each recording, found by Gauss-Newton steps from its first second.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify import parameters, recording_format
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import Robot, dynamics, kinematics

_REACH = 0.02  # time to either side of a row that its cubic spans, s
_LEAST_ROWS = 5  # to either side, below which a cubic smooths nothing
_NOISY = 0.02  # noise of a velocity below which it is taken as measured, rad/s


def start_states(recording: Recording) -> tuple[Array, Array]:
    """Return joint position and velocity at every row to start a simulation from, (rows, 2) each.

    Rows up to 20 ms to either side have a say in it where a clamped leg's velocities are noisy.
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

    With the foot on the ground the joints' velocities tell it, but for how far the ground gives.
    Differences are of three rows from the same side of touchdown and lift-off, where possible.
    Where both joints stand still to the last digit the leg has not begun to move.
    """
    time, height = recording.time, recording.trace.column("height_m")
    position, velocity = full_states(recording)
    clearance = kinematics.foot_clearance(robot, height, position)
    stands = clearance <= 0
    known = np.where(stands, kinematics.foot_velocity(robot, position, velocity)[:, 0], 0.0)
    course = np.where(stands, clearance, height)
    rate = np.asarray(np.gradient(height, time))
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
    """
    position = _filled(recording, "position")
    velocity = _filled(recording, "velocity")
    slope = np.gradient(position, recording.time, axis=0)
    return position, np.where(np.isnan(velocity), slope, velocity)


def _smoothed(time: Array, position: Array, velocity: Array) -> tuple[Array, Array]:
    """Return a joint's position and velocity by cubics in time around every row, (rows,) each."""
    half = int(_REACH / np.median(np.diff(time)) + 1e-6) if len(time) > 1 else 0
    if half < _LEAST_ROWS or len(time) < 4 * half:
        return position, velocity
    count = 2 * half + 1
    first = np.clip(np.arange(len(time)) - half, 0, len(time) - count)
    rows = first[:, None] + np.arange(count)
    t = time[rows] - time[:, None]
    scale = float(np.abs(t).max())
    powers = (t / scale)[..., None] ** np.arange(4)
    slopes = np.zeros_like(powers)
    slopes[..., 1:] = powers[..., :-1] * np.arange(1, 4) / scale

    def fit(of_position: float, of_velocity: float) -> tuple[Array, Array]:
        """Return the cubics' positions and velocities where the sensors have these weights."""
        design = np.concatenate((powers * of_position, slopes * of_velocity), axis=1)
        values = (position[rows] * of_position, velocity[rows] * of_velocity)
        target = np.concatenate(values, axis=1)[..., None]
        turned = design.swapaxes(1, 2)
        normal = turned @ design
        if not of_position:
            normal[:, 0, 0] = 1.0
        found = np.linalg.solve(normal, turned @ target)
        return found[:, 0, 0], found[:, 1, 0] / scale

    noise_q = float(np.std(position - fit(1.0, 0.0)[0]))
    noise_v = float(np.std(velocity - fit(0.0, 1.0)[1]))
    if noise_v < _NOISY:
        return position, velocity
    return fit(1 / max(noise_q, 1e-6), 1 / noise_v)


def _filled(recording: Recording, quantity: str) -> Array:
    """Return a measured quantity without gaps where that is possible, (ticks, 2)."""
    values, times = recording.array(quantity), recording.time
    values = np.where(np.isnan(values), recording.array(f"{quantity}_estimate"), values)
    for joint in values.T:
        known = ~np.isnan(joint)
        if known.any():
            joint[:] = np.interp(times, times[known], joint[known])
    return values


SETTLING = 1.0  # Beginning of a recording from which its offsets are found, s
_SPAN = 0.2  # over which momentum is balanced, s
_GRID = 2e-3
_ROWS = round(_SPAN / _GRID)
_DRAG = 0.05  # speed at which friction is fully there, rad/s
_STEP = 1e-3
_LIKELY = 0.2  # deviation of offsets beforehand, rad, so that a leg that did not move says zero
_LEAST = 0.02  # error of torques that is always there, N m
_ITERATIONS = 3


def has_encoder_offsets(metadata: recording_format.RecordingMetadata) -> bool:
    """Return whether the offsets of a recording have to be found from it."""
    return metadata.zeroed and metadata.rig == "fixed-base" and metadata.onboard == "torque"


class OffsetFinder:
    """What the encoders of one recording of torque commands show when the leg hangs straight."""

    def __init__(self, recording: Recording) -> None:
        position, velocity = start_states(recording)
        time = recording.time
        stop = min(float(time[-1]), float(time[0]) + SETTLING)
        self._grid = np.arange(float(time[0]), stop, _GRID)
        command = np.nan_to_num(recording.array("torque_command"))
        pushes = np.diff(time)[:, None] * command[:-1]
        # before the first row its command holds
        self._time = np.append(time[0] - 1.0, time)
        self._impulse = np.concatenate([-command[:1], 0 * command[:1], np.cumsum(pushes, axis=0)])
        self._q, self._qd = (
            np.stack([np.interp(self._grid, time, column) for column in values.T], axis=1)
            for values in (position, velocity)
        )

    def find(self, hypothesis: parameters.LegHypothesis) -> Array:
        """Return the offsets of hip and knee if the leg is as the hypothesis, rad, (2,)."""
        offsets = np.zeros(2)
        if len(self._grid) <= 2 * _ROWS:
            return offsets
        torque = self._torque(hypothesis)
        for _ in range(_ITERATIONS):
            error = self._imbalance(hypothesis, offsets, torque)
            slopes = [
                (self._imbalance(hypothesis, offsets + shift, torque) - error) / _STEP
                for shift in _STEP * np.eye(2)
            ]
            # Balances that overlap tell the same again: _ROWS of them count as one.
            weight = 1 / np.sqrt(_ROWS * (np.mean(error**2, axis=0) + _LEAST**2))
            design = np.stack([(weight * s).ravel() for s in slopes], axis=1)
            pull = design.T @ (weight * error).ravel() + offsets / _LIKELY**2
            offsets = offsets - np.linalg.solve(design.T @ design + np.eye(2) / _LIKELY**2, pull)
        return offsets

    def _torque(self, hypothesis: parameters.LegHypothesis) -> Array:
        """Return what the joints felt until the next moment of the grid, N m, (n, 2)."""
        edges = np.append(self._grid, self._grid[-1] + _GRID) - hypothesis.drive.delay
        impulse = [np.interp(edges, self._time, column) for column in self._impulse.T]
        felt = np.diff(np.stack(impulse, axis=1), axis=0) / _GRID
        return np.asarray(hypothesis.robot.of_joints("torque_gain") * felt)

    def _imbalance(
        self, hypothesis: parameters.LegHypothesis, offsets: Array, torque: Array
    ) -> Array:
        """Return the mean torque over each span that momentum misses, N m, (n, 2)."""
        robot, q, qd = hypothesis.robot, self._q - offsets, self._qd
        momentum = np.einsum("nij,nj->ni", dynamics.mass_matrix(robot, q)[:, 1:, 1:], qd)
        lever = robot.shank.mass * robot.shank.com * robot.thigh.length
        force = torque - dynamics.gravity_force(robot, q)[:, 1:]
        force[:, 1] -= lever * np.sin(q[:, 1]) * qd[:, 0] * (qd[:, 0] + qd[:, 1])
        load = hypothesis.robot.of_joints("load_friction") * np.abs(torque)
        force -= (robot.of_joints("friction") + load) * np.tanh(qd / _DRAG)
        force -= robot.of_joints("damping") * qd
        impulse = np.cumsum(force, axis=0) * _GRID
        excess: Array = (momentum - impulse) / _SPAN
        return excess[_ROWS:] - excess[:-_ROWS]
