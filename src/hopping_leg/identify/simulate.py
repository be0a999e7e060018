"""All hypotheses times all windows simulated at once, under the controller of the recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.window_group import WindowGroup
from hopping_leg.identify.windows import Window
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Simulated:
    """What recordings would have been, row by row; NaN beyond a window's end or a failure.

    Attributes:
        position: rad, (hypotheses, windows, rows, 2).
        velocity: rad/s, (hypotheses, windows, rows, 2).
        torque: As the rig would have measured it, N m, (hypotheses, windows, rows, 2).
        height: Of the base, m, (hypotheses, windows, rows); NaN where it is fixed.
    """

    position: Array
    velocity: Array
    torque: Array
    height: Array


class WindowSimulator:
    """Simulates windows of recordings for any number of hypotheses at once.

    Windows of the same rig, rate and on-board controller share one ``mujoco.batch.Batch``; results
    do not depend on the number of threads, nor on what else is simulated beside a hypothesis.

    Args:
        recordings: What was recorded.
        windows: Which stretches to simulate.
        timestep: Physics step, s; the training's own by default.
        threads: Worker threads, 0 for one per core.

    Raises:
        UsageError: There is no window.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        windows: Sequence[Window],
        *,
        timestep: float = TIMESTEP,
        threads: int = 0,
    ) -> None:
        if not windows:
            raise UsageError("There is nothing to simulate; give at least one window.")
        self.recordings, self.windows = tuple(recordings), tuple(windows)
        self.timestep, self.threads = timestep, threads
        self.rows = max(w.length for w in windows)
        kinds: dict[tuple[object, ...], list[int]] = {}
        for index, window in enumerate(windows):
            metadata = recordings[window.recording].metadata
            kind = (metadata.rig, metadata.rate_hz, metadata.onboard, metadata.effective_gravity)
            kinds.setdefault(kind, []).append(index)
        self._groups = [
            (ids, WindowGroup(recordings, [windows[i] for i in ids], timestep, threads))
            for ids in kinds.values()
        ]

    def run(self, hypotheses: Sequence[LegHypothesis]) -> Simulated:
        """Simulate every window with every hypothesis.

        Raises:
            RecordingError: A recording and its hypothesis leave a needed gain open.
            RobotError: A hypothesis's robot is impossible.
        """
        shape = (len(hypotheses), len(self.windows), self.rows, 2)
        position, velocity, torque = (np.full(shape, np.nan) for _ in range(3))
        height = np.full(shape[:3], np.nan)
        for ids, group in self._groups:
            parts = group.run(hypotheses)
            for whole, part in zip((position, velocity, torque, height), parts, strict=True):
                whole[:, ids, : part.shape[2]] = part
        return Simulated(position, velocity, torque, height)
