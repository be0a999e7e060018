"""Judging a hypothesis on recordings: in closed loop, and predicting open-loop from torques."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.cost import measured
from hopping_leg.identify.encoder_offsets import SETTLING, has_encoder_offsets
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Pair
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window, cut, duration
from hopping_leg.robot.model import TIMESTEP

HORIZONS = (0.2, 0.5, 1.0)
"""How far to predict without looking at the recording again, s."""

_UNSCORED = 1.0
"""Beginning of a recording that does not count in closed loop, s, or a quarter of a short one."""

_NOTHING: Pair = (float("nan"), float("nan"))
"""Where nothing counts."""


@dataclass(frozen=True)
class Validation:
    """Root mean square errors, (hip, knee), on exact samples only; NaN where nothing counts.

    Attributes:
        closed_loop_position: Under the recording's own controller from its first row on, rad;
            recordings that command torques have none and do not count.
        closed_loop_torque: Likewise, N m.
        open_loop_position: By horizon in s: driven by the recorded torques alone, rad.
    """

    closed_loop_position: Pair
    closed_loop_torque: Pair
    open_loop_position: dict[float, Pair]


def validate(
    recordings: Sequence[Recording],
    hypothesis: LegHypothesis,
    timestep: float = TIMESTEP,
    threads: int = 0,
) -> Validation:
    """Judge a hypothesis; a recording that is shorter than a horizon is left out there.

    Args:
        recordings: Best those that no fit has seen.
        hypothesis: What to judge.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.

    Raises:
        RecordingError: A recording is too short to judge anything.
    """
    closed = _closed_loop(recordings, hypothesis, timestep, threads)
    predicted = {}
    for horizon in HORIZONS:
        long_enough = [r for r in recordings if _reaches(r, horizon)]
        predicted[horizon] = open_loop(long_enough, hypothesis, horizon, timestep, threads)
    return Validation(*closed, predicted)


def _closed_loop(
    recordings: Sequence[Recording],
    hypothesis: LegHypothesis,
    timestep: float,
    threads: int,
) -> tuple[Pair, Pair]:
    """Return the rms errors of position, rad, and torque, N m."""
    controlled = [r for r in recordings if r.metadata.onboard != "torque"]
    if not controlled:
        return _NOTHING, _NOTHING
    windows = cut(controlled, None, unscored=_unscored(recordings))
    simulator = WindowSimulator(controlled, windows, timestep=timestep, threads=threads)
    simulated = simulator.run([hypothesis])
    position, torque = (
        _rms(getattr(simulated, name)[0] - measured(simulator, name))
        for name in ("position", "torque")
    )
    return position, torque


def open_loop(
    recordings: Sequence[Recording],
    hypothesis: LegHypothesis,
    horizon: float,
    timestep: float = TIMESTEP,
    threads: int = 0,
) -> Pair:
    """Return the rms position error of predictions restarted every half horizon, rad.

    The motors get the measured torque, or the commanded one where the rig drives torques itself;
    every measured row of a horizon counts. The beginning of a recording from which its own offsets
    are found predicts nothing.
    """
    driven = [d for d in map(as_torque_driven, recordings) if d.has("torque_command")]
    if not driven:
        return _NOTHING
    windows = [w for w in cut(driven, horizon, stride=horizon / 2) if _starts_known(driven, w)]
    if not windows:
        return _NOTHING
    simulator = WindowSimulator(driven, windows, timestep=timestep, threads=threads)
    return _rms(simulator.run([hypothesis]).position[0] - measured(simulator, "position"))


def as_torque_driven(recording: Recording) -> Recording:
    """Return the recording as if its torques had been commanded, without an on-board PD.

    A row's torque is the one before its command acts: what a ``zoh`` PD held until then, so the
    next row's is this row's command; between rows of a ``continuous`` PD the mean of both acted.
    """
    if recording.metadata.onboard == "torque":
        return recording
    table = recording.trace.table
    columns = {"hip_command_nm": "hip_torque_nm", "knee_command_nm": "knee_torque_nm"}
    acted = {
        command: table[measured_].interpolate().fill_null(strategy="backward")
        for command, measured_ in columns.items()
        if measured_ in table.columns
    }
    share = 1.0 if recording.metadata.onboard == "zoh" else 0.5
    table = table.with_columns(
        ((1 - share) * now + share * now.shift(-1).fill_null(strategy="forward")).alias(command)
        for command, now in acted.items()
    )
    trace = dataclasses.replace(recording.trace, table=table)
    return dataclasses.replace(recording, trace=trace).with_metadata(onboard="torque")


def _starts_known(recordings: Sequence[Recording], window: Window) -> bool:
    """Return whether a window starts where the state is known.

    That is in a row that was measured or is at least next to measured ones, and where offsets have
    to be found, after the rows that tell them.
    """
    recording = recordings[window.recording]
    since = recording.time[window.start] - recording.time[0]
    if has_encoder_offsets(recording.metadata) and since < SETTLING:
        return False
    state = recording.array("position")[window.start], recording.array("velocity")[window.start]
    return bool(np.isfinite(state).all()) or recording.has("position_estimate")


def _rms(errors: Array) -> Pair:
    """Return the root mean square over everything but the joint, ignoring NaN."""
    flat = errors.reshape(-1, 2)
    counts = np.count_nonzero(~np.isnan(flat), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        hip, knee = np.sqrt(np.nansum(np.square(flat), axis=0) / counts)
    return float(hip), float(knee)


def _unscored(recordings: Sequence[Recording]) -> float:
    """Return the beginning of each recording that does not count in closed loop, s."""
    return min(_UNSCORED, 0.25 * min(map(duration, recordings)))


def _reaches(recording: Recording, horizon: float) -> bool:
    rows = max(s.stop - s.start for s in recording.segments())
    return bool(rows >= max(3, round(horizon * recording.metadata.rate_hz)))


RESTART = 0.5
"""Where a recording's torques are commanded there is no loop that holds the simulation to it; it
is started anew so often, s."""


@dataclass(frozen=True)
class Overlay:
    """One recording; NaN where nothing was measured or simulated.

    Attributes:
        recording: The recording or part of one.
        restarted: Whether the simulation was started anew every ``RESTART``.
        position: Measured, and counted, rad, (rows, 2).
        torque: Likewise, N m, (rows, 2).
        simulated_position: By each hypothesis, rad, (hypotheses, rows, 2).
        simulated_torque: Likewise, N m, (hypotheses, rows, 2).
    """

    recording: Recording
    restarted: bool
    position: Array
    torque: Array
    simulated_position: Array
    simulated_torque: Array

    def errors(self, quantity: str) -> Array:
        """Return simulated minus measured, (hypotheses, rows, 2).

        Args:
            quantity: ``position`` or ``torque``.
        """
        difference: Array = getattr(self, f"simulated_{quantity}") - getattr(self, quantity)
        return difference


def overlays(
    recordings: Sequence[Recording],
    hypotheses: Sequence[LegHypothesis],
    timestep: float,
    threads: int = 0,
) -> list[Overlay]:
    """Simulate recordings with hypotheses.

    Args:
        recordings: Best those that no fit has seen.
        hypotheses: To compare.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.
    """
    skip, drawn = _unscored(recordings), []
    for recording in recordings:
        restarted = recording.metadata.onboard == "torque"
        length, unscored = (RESTART, 0.0) if restarted else (None, skip)
        windows = cut([recording], length, unscored=unscored)
        simulator = WindowSimulator([recording], windows, timestep=timestep, threads=threads)
        simulated, filled = simulator.run(hypotheses), {}
        for name in ("position", "torque"):
            values = measured(simulator, name)[None]
            filled[name] = _in_rows(values, windows, len(recording))[0]
            values = getattr(simulated, name)
            filled[f"simulated_{name}"] = _in_rows(values, windows, len(recording))
        drawn.append(Overlay(recording, restarted, **filled))
    return drawn


def _in_rows(values: Array, windows: Sequence[Window], rows: int) -> Array:
    """Put windows (n, windows, length, 2) where they lie in their recording, (n, rows, 2)."""
    placed = np.full((len(values), rows, 2), np.nan)
    for index, window in enumerate(windows):
        stop = window.start + window.length
        placed[:, window.start : stop] = values[:, index, : window.length]
    return placed
