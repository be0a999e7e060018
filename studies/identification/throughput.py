"""What a candidate costs: simulated in one batch, and in a plain loop, in turn in the same run."""

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.actuator_model import build_rig_model
from hopping_leg.identify.initial_states import base_rate, start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window, cut
from hopping_leg.robot import TIMESTEP, MotorLimit, Robot
from studies.identification.study import Study
from studies.identification.twin import believed, record_paper
from studies.shared import Timed, host, interleave, median_ratio


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


def throughput(
    study: Study, on_repeat: Callable[[int, int], None] = lambda done, total: None
) -> dict[str, Any]:
    """Time a generation on the paper's recordings.

    Each loop simulates one candidate, each batch a whole generation; all simulate the same
    windows, steps and PD, which is checked.

    Args:
        study: Length of the recordings, candidates, rounds.
        on_repeat: Called with (rounds done, rounds in all).

    Returns:
        Seconds per candidate, and how many times faster the batch is, on one thread and on two.
    """
    recordings = record_paper(study.throughput_seconds)
    plan = make_plan(recordings, believed(), search="two-pass")
    windows = cut(recordings, plan.window, unscored=plan.unscored)
    rng = np.random.default_rng(study.seed)
    low, high = (np.clip(bound, -1, 1) for bound in plan.parameters.bounds)
    vectors = rng.uniform(low, high, (study.population, len(low)))
    candidates = plan.parameters.hypotheses(vectors)
    loop = PlainLoop(recordings, windows, TIMESTEP)
    batches = {
        threads: WindowSimulator(recordings, windows, timestep=TIMESTEP, threads=threads)
        for threads in (1, 2)
    }
    functions: dict[str, Timed] = {
        "loop": lambda: _run_loop(loop, candidates[0], whole_ticks=False),
        "loop_ticks": lambda: _run_loop(loop, candidates[0], whole_ticks=True),
        "batch_1": lambda: _run_batch(batches[1], candidates),
        "batch_2": lambda: _run_batch(batches[2], candidates),
    }
    taken = interleave(functions, study.repeats, on_repeat)
    per = {n: t / (study.population if n.startswith("batch") else 1) for n, t in taken.items()}
    return {
        "rows": [
            _row("Python loop, one physics step per mj_step call", per["loop"], per["loop"]),
            _row("Python loop, one control period per call", per["loop_ticks"], per["loop"]),
            _row("batch, one thread", per["batch_1"], per["loop"]),
            _row("batch, two threads", per["batch_2"], per["loop"]),
        ],
        "batch_one_thread_over_loop": median_ratio(per["loop"], per["batch_1"]),
        "batch_two_threads_over_loop": median_ratio(per["loop"], per["batch_2"]),
        "batch_two_threads_over_one": median_ratio(per["batch_1"], per["batch_2"]),
        "largest_difference_rad": _difference(loop, batches[1], candidates[0]),
        "recorded_s": 2 * study.throughput_seconds,
        "paper_size_share": study.throughput_seconds / 240.0,
        "windows": len(windows),
        "window_s": plan.window,
        "candidates": study.population,
        "timestep_s": TIMESTEP,
        "repeats": study.repeats,
        "host": host(),
    }


def _row(what: str, seconds: Array, loop: Array) -> dict[str, Any]:
    return {
        "what": what,
        "s_per_candidate": float(np.median(seconds)),
        "times_faster": median_ratio(loop, seconds),
    }


def _run_loop(loop: PlainLoop, candidate: LegHypothesis, *, whole_ticks: bool) -> None:
    loop.run(candidate, whole_ticks=whole_ticks)


def _run_batch(batch: WindowSimulator, candidates: list[LegHypothesis]) -> None:
    batch.run(candidates)


def _difference(loop: PlainLoop, batch: WindowSimulator, candidate: LegHypothesis) -> float:
    """Return the largest difference of a joint position between the two ways, rad."""
    plain, batched = loop.run(candidate), batch.run([candidate]).position[0]
    pairs = zip(plain, batched, strict=True)
    return float(max(np.abs(rows - other[: len(rows)]).max() for rows, other in pairs))
