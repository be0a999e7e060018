"""All hypotheses times all windows simulated at once, under the controller of the recording.

A window begins in a measured state.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hopping_leg.arrays import Array, Records
from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify import hops, initial_states, parameters, replay
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import COARSE_TIMESTEP, Robot, kinematics, load_robot
from hopping_leg.sim.compiled import announce
from hopping_leg.sim.leg_table import LEG, leg_table

_GAINS = ("stiffness", "damping", "integral")
_ONBOARD = {"torque": replay.TORQUE, "zoh": replay.ZOH, "continuous": replay.CONTINUOUS}
_SURPLUS = 0.3  # share of an inertia beyond which damping is not made up for
_UNLIMITED = 1e6  # N m
_PARTS = 4  # pieces of work per thread, as windows differ in length


@dataclass(frozen=True)
class Window:
    """Rows ``start`` to ``start + length`` of a recording."""

    recording: int
    """Index of the recording."""
    start: int
    """First row, whose state starts the simulation."""
    length: int
    unscored: int = 1
    """Rows at the beginning that no residual counts, while the start's error decays."""
    joints: int | None = None
    """Rows in which joints count; None for all."""


def cut(
    recordings: Sequence[Recording],
    duration: float | None = None,
    *,
    stride: float | None = None,
    unscored: float = 0.0,
) -> list[Window]:
    """Cut recordings into windows of one duration, s, whose first ``unscored`` s do not count.

    Recordings of hops are cut as ``hops`` says, whatever the duration. Without a duration each
    recording is one window, as in the paper. The stride, s, is from one window's start to the next;
    without it there is no gap and no overlap.
    """
    windows: list[Window] = []
    for index, recording in enumerate(recordings):
        rate = recording.metadata.rate_hz
        skip = max(1, round(unscored * rate))
        before = len(windows)
        if hops.by_hops(recording):
            found = hops.hop_windows(recording, load_robot(recording.metadata.robot))
            windows += [Window(index, first, length, joints=n) for first, length, n in found]
            continue
        for segment in recording.segments():
            rows = segment.stop - segment.start
            length = rows if duration is None else round(duration * rate)
            if length <= skip + 1:
                continue
            step = length if stride is None else max(1, round(stride * rate))
            starts = range(segment.start, segment.stop - length + 1, step)
            windows += [Window(index, start, length, skip) for start in starts]
        if len(windows) == before:
            wanted = f"windows of {duration:g} s" if duration else "one window"
            raise RecordingError(
                f"{recording.name} has {len(recording)} rows, {len(recording) / rate:.3g} s, too"
                f" short for {wanted} of which {skip / rate:.3g} s do not count; record longer."
            )
    return windows


@cache
def compile_replay() -> None:
    """Compile the replay before its first use, or load it."""
    state, result = np.zeros((1, 1, 6)), np.zeros((1, 1, 1, replay.RESULT))
    table, drives = np.zeros((1, 1), LEG), np.zeros(1, replay.DRIVE)
    rows, spans = np.zeros(1, replay.ROW), np.zeros(1, replay.SPAN)
    announce(replay.replay)
    replay.replay(table, drives, rows, spans, 0, COARSE_TIMESTEP, state, 0, 0, result)


def _drive_values(hypotheses: Sequence[parameters.LegHypothesis], name: str) -> Array:
    """Return an attribute of both drives, (hypotheses, 2)."""
    return np.array([[getattr(h.drive.hip, name), getattr(h.drive.knee, name)] for h in hypotheses])


class _WindowGroup:
    """Windows of one kind of recording; arguments as ``WindowSimulator``."""

    def __init__(
        self,
        recordings: Sequence[Recording],
        windows: Sequence[Window],
        timestep: float,
        threads: int,
    ) -> None:
        self._timestep, self._threads = timestep, threads or os.cpu_count() or 1
        numbers = sorted({w.recording for w in windows})
        self._recordings = [recordings[n] for n in numbers]
        self._metadata = self._recordings[0].metadata
        period = min(r.metadata.period for r in self._recordings)
        if timestep > period * 1.001:
            raise UsageError(f"A physics step of {timestep} s is longer than {period:g} s, a row.")
        self._of_window = np.array([numbers.index(w.recording) for w in windows])
        starts = np.cumsum([0, *map(len, self._recordings)])
        self._spans = np.zeros(len(windows), replay.SPAN)
        self._spans["recording"] = self._of_window
        self._spans["first"] = starts[self._of_window]
        self._spans["start"] = self._spans["first"] + [w.start for w in windows]
        self._spans["length"] = [w.length for w in windows]
        self._rows = np.concatenate([_recorded_rows(r) for r in self._recordings])
        self._moving = self._metadata.rig != "fixed-base"
        zeroed = initial_states.has_encoder_offsets(self._metadata)
        self._offsets = [initial_states.OffsetFinder(r) for r in self._recordings if zeroed]
        self._bases: dict[tuple[float, ...], tuple[Array, Array]] = {}

    def run(self, hypotheses: Sequence[parameters.LegHypothesis]) -> Array:
        """Return the results, (hypotheses, windows, rows, ``RESULT``)."""
        offsets = np.zeros((len(hypotheses), len(self._of_window), 2))
        if self._offsets:
            found = np.array([[finder.find(h) for finder in self._offsets] for h in hypotheses])
            offsets = found[:, self._of_window]
        table, drives = self._table(hypotheses), self._drives(hypotheses)
        state = self._start(hypotheses, offsets)
        shape = (*state.shape[:2], int(self._spans["length"].max()), replay.RESULT)
        result = np.full(shape, np.nan)

        def work(first: int, last: int) -> None:
            replay.replay(
                table, drives, self._rows, self._spans, _ONBOARD[self._metadata.onboard],
                self._timestep, state, first, last, result,
            )  # fmt: skip

        compile_replay()
        pairs = state.shape[0] * state.shape[1]
        ends = np.linspace(0, pairs, min(pairs, _PARTS * self._threads) + 1).astype(int)
        with ThreadPoolExecutor(self._threads) as pool:
            list(pool.map(work, ends[:-1], ends[1:]))
        result[..., 0:2] += offsets[:, :, None]
        result[..., 4:6] *= _drive_values(hypotheses, "sensor_gain")[:, None, None]
        if not self._moving:
            result[..., 6] = np.nan
        elif hops.by_hops(self._recordings[0]):  # where its ground is nobody measured
            result[..., 6] -= result[:, :, :1, 6]
        return result

    def _table(self, hypotheses: Sequence[parameters.LegHypothesis]) -> Records:
        """Return the legs' rows with the software limits of drives, (hypotheses, recordings)."""
        robots, boom = [h.robot for h in hypotheses], self._metadata.boom
        if boom.radius:
            robots = [replace(robot, boom=boom + robot.boom) for robot in robots]
        legs = leg_table(robots, self._timestep, fixed_base=not self._moving)
        # Damping is implicit, the drives' own, too: half a step of it would pass for inertia.
        damping = legs["damping"].copy()
        if self._metadata.onboard == "continuous":
            own = _drive_values(hypotheses, "damping")
            own = np.where(np.isnan(own), self._rows["gains"][0, 2:4], own)
            damping += legs["gain"] * own
        for joint, inertia in enumerate(("hip_inertia", "knee_inertia")):
            surplus = self._timestep / 2 * damping[:, joint]
            elastic, armature = legs["elastic"][:, joint] > 0, legs["armature"][:, joint]
            armature -= np.where(elastic, np.minimum(surplus, _SURPLUS * armature), 0.0)
            surplus = np.where(elastic, 0.0, surplus)
            legs[inertia] -= np.minimum(surplus, _SURPLUS * legs[inertia])
        creep = np.array([h.drive.creep for h in hypotheses])[:, None]
        soft = legs["friction"] / np.maximum(creep, 1e-6) * self._timestep
        soft = np.where(legs["friction"] > 0, np.minimum(soft, legs["friction_stiffness"]), 1.0)
        legs["friction_stiffness"] = np.where(creep > 0, soft, legs["friction_stiffness"])
        legs["friction_damping"][creep[:, 0] > 0] = 1 / self._timestep
        if self._metadata.rig == "boom":  # its torques were measured, and known no limit
            for name in ("torque_limit", "saturation", "stall_torque"):
                legs[name] = _UNLIMITED
        table = np.repeat(legs[:, None], len(self._recordings), axis=1)
        for n, recording in enumerate(self._recordings):
            if recording.metadata.torque_limit is not None:
                table["torque_limit"][:, n] = recording.metadata.torque_limit
            # Where a joint has been, nothing stops it, if its motor shows where it is.
            seen = np.where(legs["elastic"][:, None] > 0, np.nan, recording.array("position"))
            for stop, extreme in (("lower", np.fmin), ("upper", np.fmax)):
                most = extreme.reduce(seen, axis=1)
                table[f"stop_{stop}"][:, n] = extreme(table[f"stop_{stop}"][:, n], most)
        limits = _drive_values(hypotheses, "torque_limit")[:, None]
        table["torque_limit"] = np.where(np.isnan(limits), table["torque_limit"], limits)
        return table

    def _drives(self, hypotheses: Sequence[parameters.LegHypothesis]) -> Records:
        drives = np.zeros(len(hypotheses), replay.DRIVE)
        for name in ("delay", "ramp"):
            drives[name] = [getattr(h.drive, name) for h in hypotheses]
        if self._metadata.onboard == "torque":
            return drives
        drives["gains"] = np.concatenate([_drive_values(hypotheses, n) for n in _GAINS], axis=1)
        for index, name in enumerate(_GAINS[:2]):
            columns = slice(2 * index, 2 * index + 2)
            unknown = np.isnan(self._rows["gains"][:, columns]).any(axis=0)
            if (unknown & np.isnan(drives["gains"][:, columns])).any():
                raise RecordingError(
                    f"{self._recordings[0].name} does not say the {name} of its on-board PD; state"
                    " it, or fit that of drive.hip and drive.knee."
                )
        return drives

    def _start(self, hypotheses: Sequence[parameters.LegHypothesis], offsets: Array) -> Array:
        """Return the states that windows start in, (hypotheses, windows, 6)."""
        measured = self._rows["state"][self._spans["start"]]
        state = np.zeros((len(hypotheses), len(measured), 6))
        state[..., 1:3] = measured[:, :2] - offsets
        state[..., 4:6] = measured[:, 2:]
        if self._moving:
            for one, h in zip(state, hypotheses, strict=True):
                height, rate = self._base(h.robot)
                standing = kinematics.stance_height(h.robot, measured[:, :2])
                one[:, 0], one[:, 3] = np.where(np.isnan(height), standing, height), rate
        return state

    def _base(self, robot: Robot) -> tuple[Array, Array]:
        """Return the base's first height, m, NaN where it stands, and speed in windows, m/s."""
        lengths = (robot.thigh.length, robot.shank.length, robot.foot.radius)
        if lengths not in self._bases:
            found = [hops.start_heights(recording, robot) for recording in self._recordings]
            heights, rates = np.concatenate(found, axis=1)[:, self._spans["start"]]
            self._bases[lengths] = heights, rates
        return self._bases[lengths]


def _recorded_rows(recording: Recording) -> Records:
    rows, metadata = np.zeros(len(recording), replay.ROW), recording.metadata
    rows["time"] = recording.time
    rows["state"] = np.concatenate(initial_states.start_states(recording), axis=1)
    for name in ("position", "velocity", "torque"):
        rows[name] = np.nan_to_num(recording.array(f"{name}_command"))
    if metadata.rig == "boom" and recording.has("torque"):  # a row late, as it answers
        rows["torque"][:-1] = np.nan_to_num(recording.array("torque"))[1:]
    rows["slope"][:-1] = rows["velocity"][:-1]
    for column, name in ((0, "stiffness"), (2, "damping")):  # rows win over the metadata
        found, stated = recording.array(name), getattr(metadata, name) or (np.nan, np.nan)
        rows["gains"][:, column : column + 2] = np.where(np.isnan(found), stated, found)
    rows["gains"][:, 4:] = metadata.integral or (0.0, 0.0)
    return rows


@dataclass(frozen=True)
class SimulatedWindows:
    """What recordings would have been, row by row; NaN beyond a window's end or a failure."""

    position: Array
    """rad, (hypotheses, windows, rows, 2)"""
    velocity: Array
    """rad/s, likewise."""
    torque: Array
    """As the rig would have measured it, N m, likewise."""
    height: Array
    """Height of the base, m, (hypotheses, windows, rows); NaN where it is fixed."""


class WindowSimulator:
    """Simulates windows of recordings for any number of hypotheses at once.

    Windows of the same rig and on-board controller are one compiled call; results depend neither on
    the number of threads, nor on what else is simulated beside a hypothesis.

    The physics step, s, is the training's own by default; 0 threads are one per core.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        windows: Sequence[Window],
        *,
        timestep: float = COARSE_TIMESTEP,
        threads: int = 0,
    ) -> None:
        self.recordings, self.windows = tuple(recordings), tuple(windows)
        self.timestep, self.threads = timestep, threads
        self.rows = max(w.length for w in windows)
        kinds: dict[tuple[object, ...], list[int]] = {}
        for index, window in enumerate(windows):
            recording = recordings[window.recording]
            metadata, alike = recording.metadata, hops.by_hops(recording)
            kind = (metadata.rig, metadata.onboard, metadata.boom, metadata.zeroed, alike)
            kinds.setdefault(kind, []).append(index)
        self._groups = [
            (ids, _WindowGroup(recordings, [windows[i] for i in ids], timestep, threads))
            for ids in kinds.values()
        ]

    def run(self, hypotheses: Sequence[parameters.LegHypothesis]) -> SimulatedWindows:
        """Simulate every window with every hypothesis."""
        shape = (len(hypotheses), len(self.windows), self.rows, replay.RESULT)
        whole = np.full(shape, np.nan)
        for ids, group in self._groups:
            part = group.run(hypotheses)
            whole[:, ids, : part.shape[2]] = part
        return SimulatedWindows(whole[..., 0:2], whole[..., 2:4], whole[..., 4:6], whole[..., 6])
