"""What a fit simulates, written as a plain Python loop over mj_step: the yardstick of speed."""

from collections.abc import Sequence

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.actuator_model import build_rig_model
from hopping_leg.identify.initial_states import base_rate, start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.windows import Window
from hopping_leg.robot.limits import MotorLimit
from hopping_leg.robot.parameters import Robot


class PlainLoop:
    """Simulates windows of recordings one after the other under the recording's 200 Hz PD.

    Args:
        recordings: With the PD's gains and, on the rail, the base's height.
        windows: To simulate.
        timestep: Physics step, s.
    """

    def __init__(
        self, recordings: Sequence[Recording], windows: Sequence[Window], timestep: float
    ) -> None:
        self._windows, self._timestep = windows, timestep
        self._setups = [recording.metadata for recording in recordings]
        self._targets = [recording.array("position_command") for recording in recordings]
        self._states = [start_states(recording) for recording in recordings]
        self._recordings = recordings

    def run(self, candidate: LegHypothesis, *, whole_ticks: bool = False) -> list[Array]:
        """Return the joint positions of each window, rad, (rows, 2).

        Args:
            candidate: Whose robot is simulated; its drives are those of the recording.
            whole_ticks: Let one call of mj_step do all physics steps between two commands.
        """
        limit = MotorLimit(candidate.robot)
        models = [build_rig_model(candidate.robot, s.rig, self._timestep) for s in self._setups]
        heights = [_heights(recording, candidate.robot) for recording in self._recordings]
        return [
            self._window(w, models[w.recording], heights[w.recording], limit, whole_ticks)
            for w in self._windows
        ]

    def _window(
        self,
        window: Window,
        model: mujoco.MjModel,
        heights: tuple[Array, Array],
        limit: MotorLimit,
        whole_ticks: bool,
    ) -> Array:
        setup, targets = self._setups[window.recording], self._targets[window.recording]
        stiffness, damping = (np.array(pair) for pair in (setup.stiffness, setup.damping))
        substeps = round(setup.period / self._timestep)
        calls, steps = (1, substeps) if whole_ticks else (substeps, 1)
        data = mujoco.MjData(model)
        q, qd = data.qpos[-2:], data.qvel[-2:]
        position, velocity = self._states[window.recording]
        q[:], qd[:] = position[window.start], velocity[window.start]
        if setup.rig != "fixed-base":
            height, rate = heights
            data.qpos[0], data.qvel[0] = height[window.start], rate[window.start]
        rows = np.empty((window.length, 2))
        for row in range(window.length):
            rows[row] = q
            torque = stiffness * (targets[window.start + row] - q) - damping * qd
            data.ctrl[:] = limit.clip(torque, qd)
            for _ in range(calls):
                mujoco.mj_step(model, data, steps)
        return rows


def _heights(recording: Recording, robot: Robot) -> tuple[Array, Array]:
    """Return the base's height and its rate at every row, m and m/s, (rows,) each."""
    if recording.metadata.rig == "fixed-base":
        return np.empty(0), np.empty(0)
    if not recording.has_column("height_m"):
        raise RecordingError(
            f"{recording.name} has no column 'height_m'; record the base's height."
        )
    return recording.trace.column("height_m"), base_rate(recording, robot)
