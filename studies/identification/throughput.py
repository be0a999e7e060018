"""What a candidate costs: replayed by the stepper, and in a plain loop, in turn in the same run."""

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError
from hopping_leg.identify.initial_states import base_rate, start_states
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window, cut
from hopping_leg.robot import COARSE_TIMESTEP, MotorLimit, Robot, compile_spec, get_spec
from studies.identification.study import Study
from studies.identification.twin import believed, record_paper
from studies.shared import Timed, host, interleave, median_ratio


def build_rig_model(robot: Robot, rig: Rig, timestep: float) -> mujoco.MjModel:
    """Compile a robot on its rig; its actuators ask for torques at the joint, less ``biasprm``."""
    spec = get_spec(robot, timestep, fixed_base=rig == "fixed-base")
    for actuator in spec.actuators:
        actuator.ctrllimited = False
        actuator.gear[0] = 1
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    return compile_spec(spec, robot.name)


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

    def run(self, candidate: LegHypothesis) -> list[Array]:
        """Return the joint positions of each window, rad, (rows, 2)."""
        robot, step = candidate.robot, self._timestep
        models = [build_rig_model(robot, s.rig, step) for s in self._setups]
        heights = [_heights(recording, robot) for recording in self._recordings]
        return [
            self._window(w, models[w.recording], heights[w.recording], MotorLimit(robot))
            for w in self._windows
        ]

    def _window(
        self,
        window: Window,
        model: mujoco.MjModel,
        heights: tuple[Array, Array],
        limit: MotorLimit,
    ) -> Array:
        setup, targets = self._setups[window.recording], self._targets[window.recording]
        stiffness, damping = (np.array(pair) for pair in (setup.stiffness, setup.damping))
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
            for _ in range(round(setup.period / self._timestep)):
                data.ctrl[:] = limit.clip(torque, qd)
                mujoco.mj_step(model, data)
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
    """Time a generation on the paper's recordings, and one candidate on its fixed base alone.

    The loop simulates one candidate, each replay a whole generation; both simulate the same
    windows, steps and PD.

    Args:
        study: Length of the recordings, candidates, rounds.
        on_repeat: Called with (rounds done, rounds in all).

    Returns:
        Seconds per candidate, and how many times faster the replay is, on one thread and on two.
    """
    recordings = record_paper(study.throughput_seconds)
    plan = make_plan(recordings, believed(), search="two-pass")
    windows = cut(recordings, plan.window, unscored=plan.unscored)
    rng = np.random.default_rng(study.seed)
    low, high = (np.clip(bound, -1, 1) for bound in plan.parameters.bounds)
    vectors = rng.uniform(low, high, (study.population, len(low)))
    candidates = plan.parameters.hypotheses(vectors)
    loop = PlainLoop(recordings, windows, COARSE_TIMESTEP)
    replays = {
        threads: WindowSimulator(recordings, windows, timestep=COARSE_TIMESTEP, threads=threads)
        for threads in (1, 2)
    }
    fixed = WindowSimulator(
        recordings[:1], cut(recordings[:1]), timestep=COARSE_TIMESTEP, threads=1
    )
    functions: dict[str, Timed] = {
        "loop": lambda: _discard(loop.run(candidates[0])),
        "replay_1": lambda: _discard(replays[1].run(candidates)),
        "replay_2": lambda: _discard(replays[2].run(candidates)),
        "fixed": lambda: _discard(fixed.run(candidates[:1])),
    }
    taken = interleave(functions, study.repeats, on_repeat)
    per = {n: t / (study.population if n.startswith("replay") else 1) for n, t in taken.items()}
    return {
        "rows": [
            _row("loop of mj_step in Python", per["loop"], per["loop"]),
            _row("replay, one thread", per["replay_1"], per["loop"]),
            _row("replay, two threads", per["replay_2"], per["loop"]),
        ],
        "fixed_base_candidate_s": float(np.median(taken["fixed"])),
        "replay_one_thread_over_loop": median_ratio(per["loop"], per["replay_1"]),
        "replay_two_threads_over_one": median_ratio(per["replay_1"], per["replay_2"]),
        "recorded_s": 2 * study.throughput_seconds,
        "paper_size_share": study.throughput_seconds / 240.0,
        "windows": len(windows),
        "window_s": plan.window,
        "candidates": study.population,
        "timestep_s": COARSE_TIMESTEP,
        "repeats": study.repeats,
        "host": host(),
    }


def _row(what: str, seconds: Array, loop: Array) -> dict[str, Any]:
    return {
        "what": what,
        "s_per_candidate": float(np.median(seconds)),
        "times_faster": median_ratio(loop, seconds),
    }


def _discard(_: object) -> None:
    """Forget a result."""
