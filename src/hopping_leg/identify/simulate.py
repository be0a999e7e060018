"""All hypotheses times all windows simulated at once, under the controller of the recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array
from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify import actuator_model, initial_states, parameters, resampling
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.windows import Window
from hopping_leg.robot import TIMESTEP, Robot, kinematics

_GAINS = ("stiffness", "damping", "integral")
_BLOCK = 256  # ticks whose commands are prepared at once
_TICKS_PER_PERIOD = 5  # at which a drive that closes its own loop renews target and limits
_WILD = 1e4  # joint velocity beyond which a simulation has broken down, rad/s


class WindowGroup:
    """Windows that share rig, rate and on-board controller.

    The simulation advances by ticks of the recording's period, rounded to physics steps; recorded
    rows may lie anywhere between ticks. Row n holds state and torque before command n acts. A
    ``zoh`` PD is computed once per tick from the simulated state; a ``continuous`` one is the
    actuators' own and acts at every physics step, its target, integral and limits renewed at
    several ticks a period. Arguments are those of ``WindowSimulator``. UsageError says that the
    physics step is longer than the period.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        windows: Sequence[Window],
        timestep: float,
        threads: int,
    ) -> None:
        self._timestep, self._threads = timestep, threads
        self._recordings = [recordings[w.recording] for w in windows]
        self._metadata = self._recordings[0].metadata
        period = self._metadata.period
        if timestep > period * 1.001:
            raise UsageError(
                f"A physics step of {timestep} s is longer than the recordings' period of"
                f" {period:g} s; take {period:g} s or less."
            )
        parts = _TICKS_PER_PERIOD if self._metadata.onboard == "continuous" else 1
        self._substeps = max(1, round(period / timestep / parts))
        self._tick = self._substeps * timestep
        self._zoh = self._metadata.onboard == "zoh"
        self._numbers = sorted({w.recording for w in windows})
        self._of_window = np.array([self._numbers.index(w.recording) for w in windows])
        self._distinct = [recordings[n] for n in self._numbers]
        self._start_rows = np.array([w.start for w in windows])
        self._prepare_rows(recordings, windows)
        self._prepare_commands()
        self._offsets = [
            initial_states.OffsetFinder(r)
            if initial_states.has_encoder_offsets(r.metadata)
            else None
            for r in self._distinct
        ]
        self._base_rates: dict[tuple[float, ...], Array] = {}
        self._batches: dict[int, batch.Batch] = {}

    def run(
        self, hypotheses: Sequence[parameters.LegHypothesis]
    ) -> tuple[Array, Array, Array, Array]:
        """Return the arrays of ``SimulatedWindows``."""
        found = [
            [np.zeros(2) if f is None else f.find(h) for f in self._offsets] for h in hypotheses
        ]
        offsets = np.array(found)[:, self._of_window]
        simulation = self._start(hypotheses, offsets)
        *history, heights = self._advance(simulation, hypotheses)
        shape = (self._rows.ticks, len(hypotheses), -1, 2)
        q, qd, torque = (values.reshape(shape) for values in history)
        height = self._rows.linear(heights.reshape(*shape[:3], 1))[..., 0]
        position, velocity = self._rows.cubic(q, qd)
        position += offsets[:, :, None]
        gain = actuator_model.drive_values(hypotheses, "sensor_gain")[:, None, None]
        offset = actuator_model.drive_values(hypotheses, "torque_offset")[:, None, None]
        measured = gain * self._rows.linear(torque) + offset
        for values in (position, velocity, measured, height):
            values[:, self._rows.padding] = np.nan
        return position, velocity, measured, height

    def _prepare_rows(self, recordings: Sequence[Recording], windows: Sequence[Window]) -> None:
        times = []
        self._begin = np.empty(len(windows))
        states = {n: initial_states.start_states(recordings[n]) for n in self._numbers}
        self._q0, self._qd0 = np.empty((len(windows), 2)), np.empty((len(windows), 2))
        self._height0 = np.full(len(windows), np.nan)
        for i, w in enumerate(windows):
            recording = recordings[w.recording]
            stamps = recording.time[w.start : w.start + w.length]
            self._begin[i] = stamps[0]
            even = self._tick * np.arange(w.length, dtype=float)
            times.append(even if self._zoh else stamps - stamps[0])
            self._q0[i], self._qd0[i] = (values[w.start] for values in states[w.recording])
            if recording.has_column("height_m"):
                self._height0[i] = recording.trace.column("height_m")[w.start]
        self._rows = resampling.RowResampling(times, self._tick)

    def _prepare_commands(self) -> None:
        self._held, self._ramps, self._gains = [], [], []
        for recording in self._distinct:
            time, names = recording.time, ("position", "velocity", "torque")
            columns = [np.nan_to_num(recording.array(f"{name}_command")) for name in names]
            self._held.append(resampling.HeldSignal(time, np.concatenate(columns, axis=1)))
            self._ramps.append(resampling.HeldSignal(time, np.zeros_like(columns[1]), columns[1]))
            rows = [actuator_model.recorded_gains(recording, name) for name in _GAINS]
            self._gains.append(resampling.HeldSignal(time, np.concatenate(rows, axis=1)))

    def _start(self, hypotheses: Sequence[parameters.LegHypothesis], offsets: Array) -> batch.Batch:
        metadata, windows = self._metadata, len(self._begin)
        models = [
            actuator_model.build_rig_model(
                h.robot, metadata.rig, self._timestep, metadata.effective_gravity
            )
            for h in hypotheses
        ]
        count = len(hypotheses) * windows
        if count not in self._batches:
            self._batches[count] = batch.Batch(models[0], count, self._threads)
        simulation = self._batches[count]
        for name in actuator_model.FIELDS:
            values = np.stack([attrgetter(name)(m) for m in models])
            simulation.expand(name)[...] = np.repeat(values, windows, axis=0)
        simulation.reset(stage=0)
        q, qd = simulation.bind("qpos"), simulation.bind("qvel")
        q[:, -2:] = (self._q0 - offsets).reshape(-1, 2)
        qd[:, -2:] = np.tile(self._qd0, (len(hypotheses), 1))
        if metadata.rig != "fixed-base":
            standing = [kinematics.stance_height(h.robot, self._q0) for h in hypotheses]
            height = np.where(np.isnan(self._height0), np.stack(standing), self._height0)
            q[:, 0] = height.ravel()
            qd[:, 0] = np.concatenate([self._base_rate(h.robot) for h in hypotheses])
        return simulation

    def _base_rate(self, robot: Robot) -> Array:
        """Return the base's first speed in each window, m/s; zero if no height was measured."""
        lengths = (robot.thigh.length, robot.shank.length, robot.foot.radius)
        if lengths not in self._base_rates:
            rates = self._base_rates[lengths] = np.zeros(len(self._begin))
            for n, recording in enumerate(self._distinct):
                if recording.has_column("height_m"):
                    mine = self._of_window == n
                    rates[mine] = initial_states.base_rate(recording, robot)[self._start_rows[mine]]
        return self._base_rates[lengths]

    def _advance(
        self, simulation: batch.Batch, hypotheses: Sequence[parameters.LegHypothesis]
    ) -> tuple[Array, Array, Array, Array]:
        """Run all ticks; return q, qd and torque, (ticks, n, 2), and base height, (ticks, n)."""
        windows, count = len(self._begin), simulation.nsim
        shape = (self._rows.ticks, count, 2)
        positions, velocities, torques = (np.full(shape, np.nan) for _ in range(3))
        heights = np.full(shape[:2], np.nan)
        q, qd = simulation.bind("qpos")[:, -2:], simulation.bind("qvel")[:, -2:]
        base = simulation.bind("qpos")[:, 0] if self._metadata.rig != "fixed-base" else np.nan
        ctrl = simulation.bind("ctrl")
        bias = simulation.expand("actuator_biasprm")
        force = simulation.expand("actuator_forcerange")
        friction = simulation.expand("dof_frictionloss")[:, -2:]
        still = friction.copy()
        bounds = actuator_model.MotorBounds(hypotheses, self._recordings)
        gain, load = (
            np.repeat([h.robot.of_joints(name) for h in hypotheses], windows, axis=0)
            for name in ("torque_gain", "load_friction")
        )
        delay = np.repeat([h.drive.delay for h in hypotheses], windows)
        line = actuator_model.DelayLine(delay / self._tick)
        window = np.repeat([h.drive.velocity_window for h in hypotheses], windows)
        lagging = (window > 0)[:, None]
        windowed = bool(lagging.any()) and not self._zoh
        seen = actuator_model.VelocityWindow(window, self._tick, q, qd)
        integral, last = np.zeros((count, 2)), np.zeros((count, 2))
        alive = np.arange(count)
        for tick in range(self._rows.ticks):
            if tick % _BLOCK == 0:
                commands, gains = self._block(tick, delay, hypotheses)
            target, rate, feed = np.split(commands[tick % _BLOCK], 3, axis=-1)
            kp, kd, ki = gains[tick % _BLOCK]
            lower, upper = bounds.at(qd)
            push = feed + ki * integral
            if windowed:
                push = push - np.where(lagging, kd * seen.push(q, qd), 0.0)
            if self._zoh:
                asked = push + kp * (target - q) + kd * (rate - qd)
                torque = ctrl.copy()
                ctrl[...] = gain * np.clip(np.add(*line.push(asked)), lower, upper)
                torque = torque if tick else ctrl.copy()
            else:
                asked = push + kp * target + kd * rate
                kd = np.where(lagging, 0.0, kd)
                reply = np.clip((last if tick else asked) - kp * q - kd * qd, lower, upper)
                torque, last = gain * reply, asked
                ctrl[...] = gain * asked
                bias[:, :, 1], bias[:, :, 2] = -gain * kp, -gain * kd
                force[..., 0], force[..., 1] = gain * lower, gain * upper
            integral += self._tick * (target - q)
            positions[tick], velocities[tick], torques[tick] = q, qd, torque
            heights[tick] = base
            if load.any():
                friction[...] = still + load * np.abs(ctrl if self._zoh else torque)
            simulation.step(ids=alive, nstep=self._substeps)
            wild = ~(np.abs(qd) < _WILD).all(axis=1)
            if wild.any():
                alive = np.setdiff1d(alive, np.flatnonzero(wild))
                if not len(alive):
                    break
        positions[:, np.setdiff1d(np.arange(count), alive)] = np.nan
        return positions, velocities, torques, heights

    def _block(
        self, tick: int, delay: Array, hypotheses: Sequence[parameters.LegHypothesis]
    ) -> tuple[Array, Array]:
        """Return a block of ticks' commands, (ticks, n, 6), and gains, (ticks, 3, n, 2)."""
        windows, number = len(self._begin), len(hypotheses)
        ticks = np.arange(tick, min(tick + _BLOCK, self._rows.ticks))[:, None, None] * self._tick
        late = np.zeros(number) if self._zoh else delay[::windows]
        late = late[:1] if (late == late[0]).all() else late
        ramp = np.array([[h.drive.ramp] for h in hypotheses])
        commands = np.empty((len(ticks), number, windows, 6))
        gains = np.empty((len(ticks), 3, number, windows, 2))
        fitted = np.array([actuator_model.drive_values(hypotheses, name) for name in _GAINS])[
            :, :, None
        ]
        for n in range(len(self._numbers)):
            mine = self._of_window == n
            start = self._begin[mine] + ticks - late[:, None]
            held = self._held[n].average(start, self._tick)
            if ramp.any():
                held = np.repeat(held, number // len(late), axis=1)
                held[..., :2] += ramp[:, None] * self._ramps[n].average(start, self._tick)
            commands[:, :, mine] = held
            rows = self._gains[n].at(start + 1e-9)
            rows = np.moveaxis(rows.reshape(*start.shape, 3, 2), 3, 1)
            gains[:, :, :, mine] = np.where(np.isnan(fitted), rows, fitted)
        if self._metadata.onboard == "torque":
            gains[...] = 0.0
        for index, name in enumerate(_GAINS[:2]):
            if np.isnan(gains[:, index]).any():
                raise RecordingError(
                    f"{self._recordings[0].name} does not say the {name} of its on-board PD; state"
                    f" it in the sidecar, or fit 'drive.hip.{name}' and 'drive.knee.{name}'."
                )
        return commands.reshape(len(ticks), -1, 6), gains.reshape(len(ticks), 3, -1, 2)


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

    Windows of the same rig, rate and on-board controller share one ``mujoco.batch.Batch``; results
    do not depend on the number of threads, nor on what else is simulated beside a hypothesis.

    The physics step, s, is the training's own by default; 0 threads are one per core. No
    window raises UsageError.
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

    def run(self, hypotheses: Sequence[parameters.LegHypothesis]) -> SimulatedWindows:
        """Simulate every window with every hypothesis.

        RecordingError says that a needed gain is open, RobotError that a robot is impossible.
        """
        shape = (len(hypotheses), len(self.windows), self.rows, 2)
        position, velocity, torque = (np.full(shape, np.nan) for _ in range(3))
        height = np.full(shape[:3], np.nan)
        for ids, group in self._groups:
            parts = group.run(hypotheses)
            for whole, part in zip((position, velocity, torque, height), parts, strict=True):
                whole[:, ids, : part.shape[2]] = part
        return SimulatedWindows(position, velocity, torque, height)
