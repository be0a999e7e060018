"""Encoders that were zeroed with the leg at rest: off by as much as friction held it from hanging.

The offsets follow from the balance of momentum. With the Lagrangian L = T - V of the leg on a fixed
base, p = dT/dq' and the torque tau less friction f,

    p(t + h) - p(t) = integral of (dT/dq - dV/dq + tau - f) from t to t + h,

which needs velocities but no accelerations. Wrong offsets tilt gravity and bend the leg:
two numbers of each recording, found by Gauss-Newton steps from its first second.
"""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.initial_states import start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import RecordingMetadata
from hopping_leg.robot import GRAVITY, dynamics

SETTLING = 1.0
"""Beginning of a recording from which its offsets are found, s."""
_SPAN = 0.2
"""Over which momentum is balanced, s."""
_GRID = 2e-3
_ROWS = round(_SPAN / _GRID)
_DRAG = 0.05
"""Speed at which friction is fully there, rad/s."""
_STEP = 1e-3
_LIKELY = 0.2
"""Deviation of offsets beforehand, rad, so that a leg that did not move says zero."""
_LEAST = 0.02
"""Error of torques that is always there, N m."""
_ITERATIONS = 3


def has_encoder_offsets(metadata: RecordingMetadata) -> bool:
    """Return whether the offsets of a recording have to be found from it."""
    return metadata.zeroed and metadata.rig == "fixed-base" and metadata.onboard == "torque"


class OffsetFinder:
    """What the encoders of one recording of torque commands show when the leg hangs straight."""

    def __init__(self, recording: Recording) -> None:
        position, velocity = start_states(recording)
        time = recording.time
        stop = min(float(time[-1]), float(time[0]) + SETTLING)
        self._grid = np.arange(float(time[0]), stop, _GRID)
        self._time, self._command = time, np.nan_to_num(recording.array("torque_command"))
        self._q, self._qd = (
            np.stack([np.interp(self._grid, time, column) for column in values.T], axis=1)
            for values in (position, velocity)
        )
        self._gravity = recording.metadata.effective_gravity / GRAVITY

    def find(self, hypothesis: LegHypothesis) -> Array:
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

    def _torque(self, hypothesis: LegHypothesis) -> Array:
        """Return what the joints felt on the grid, N m, (n, 2)."""
        late = self._grid - hypothesis.drive.delay
        row = np.searchsorted(self._time, late, side="right") - 1
        return hypothesis.robot.of_joints("torque_gain") * self._command[np.maximum(row, 0)]

    def _imbalance(self, hypothesis: LegHypothesis, offsets: Array, torque: Array) -> Array:
        """Return the mean torque over each span that momentum misses, N m, (n, 2)."""
        robot, q, qd = hypothesis.robot, self._q - offsets, self._qd
        momentum = np.einsum("nij,nj->ni", dynamics.mass_matrix(robot, q)[:, 1:, 1:], qd)
        lever = robot.shank.mass * robot.shank.com * robot.thigh.length
        force = torque - self._gravity * dynamics.gravity_force(robot, q)[:, 1:]
        force[:, 1] -= lever * np.sin(q[:, 1]) * qd[:, 0] * (qd[:, 0] + qd[:, 1])
        load = hypothesis.robot.of_joints("load_friction") * np.abs(torque)
        force -= (robot.of_joints("friction") + load) * np.tanh(qd / _DRAG)
        force -= robot.of_joints("damping") * qd
        impulse = np.cumsum(force, axis=0) * _GRID
        excess: Array = (momentum - impulse) / _SPAN
        return excess[_ROWS:] - excess[:-_ROWS]
