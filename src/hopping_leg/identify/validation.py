"""Judging a hypothesis on recordings: in closed loop, and predicting open-loop from torques."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify import initial_states, parameters
from hopping_leg.identify.cost import measured
from hopping_leg.identify.hops import by_hops
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import PAIRS, Pair
from hopping_leg.identify.simulate import Window, WindowSimulator, cut

HORIZONS = (0.2, 0.5, 1.0)  # How far to predict without looking at the recording again, s
_UNSCORED = 1.0  # beginning that does not count in closed loop, s, or a quarter of a short one


@dataclass(frozen=True)
class Validation:
    """Root mean square errors, (hip, knee), on exact samples only; NaN where nothing counts."""

    closed_loop_position_rms_rad: Pair
    """Under the recording's own controller from its first row on, rad; recordings that command
    torques have none and do not count."""
    closed_loop_torque_rms_nm: Pair
    """Likewise, N m."""
    open_loop_position_rms_rad: dict[str, Pair]
    """By horizon in s, e.g. ``"0.2"``: driven by the recorded torques alone, rad."""


def validate(
    recordings: Sequence[Recording], hypothesis: parameters.LegHypothesis, threads: int = 0
) -> Validation:
    """Judge a hypothesis on recordings; one that is shorter than a horizon is left out there.

    RecordingError says that a recording is too short to judge anything.
    """
    controlled = [r for r in recordings if r.metadata.onboard != "torque"]
    windows = cut(controlled, unscored=_unscored(recordings))
    position, torque = _errors(controlled, windows, hypothesis, threads, "position", "torque")
    ahead = {str(h): open_loop(recordings, hypothesis, h, threads) for h in HORIZONS}
    return Validation(position, torque, ahead)


def open_loop(
    recordings: Sequence[Recording],
    hypothesis: parameters.LegHypothesis,
    horizon: float,
    threads: int = 0,
) -> Pair:
    """Return the rms position error of predictions restarted every half horizon, rad.

    The motors get the measured torque, or the commanded one where the rig drives torques itself.
    A recording that is shorter than the horizon, s, is left out.
    """
    driven = [
        d
        for d in map(as_torque_driven, recordings)
        if (not by_hops(d) or horizon == HORIZONS[0])  # whose hops have one length
        and max(s.stop - s.start for s in d.segments()) >= max(3, horizon * d.metadata.rate_hz)
        and d.has("torque_command")
    ]
    windows = [w for w in cut(driven, horizon, stride=horizon / 2) if _starts_known(driven, w)]
    return _errors(driven, windows, hypothesis, threads, "position")[0]


def _errors(
    recordings: Sequence[Recording],
    windows: Sequence[Window],
    hypothesis: parameters.LegHypothesis,
    threads: int,
    *quantities: str,
) -> list[Pair]:
    if not windows:
        return [(np.nan, np.nan)] * len(quantities)
    simulator = WindowSimulator(recordings, windows, threads=threads)
    simulated, pairs = simulator.run([hypothesis]), list[Pair]()
    for quantity in quantities:
        errors = (getattr(simulated, quantity)[0] - measured(simulator, quantity)).reshape(-1, 2)
        counts = np.count_nonzero(~np.isnan(errors), axis=0)
        with np.errstate(invalid="ignore"):
            hip, knee = np.sqrt(np.nansum(np.square(errors), axis=0) / counts).tolist()
        pairs.append((hip, knee))
    return pairs


def as_torque_driven(recording: Recording) -> Recording:
    """Return the recording as if its torques had been commanded, without an on-board PD.

    A row's torque is the one before its command acts: what a ``zoh`` PD held until then, so the
    next row's is this row's command; between rows of a ``continuous`` PD the mean of both acted.
    """
    if recording.metadata.onboard == "torque":
        return recording
    share = 1.0 if recording.metadata.onboard == "zoh" else 0.5
    table = recording.trace.table
    for command, torque in zip(PAIRS["torque_command"], PAIRS["torque"], strict=True):
        if torque in table.columns:
            now = table[torque].interpolate().fill_null(strategy="backward")
            later = now.shift(-1).fill_null(strategy="forward")
            table = table.with_columns(((1 - share) * now + share * later).alias(command))
    return recording.with_table(table).with_metadata(onboard="torque")


def _starts_known(recordings: Sequence[Recording], window: Window) -> bool:
    """Return whether a window starts in or next to measured rows, after those that tell offsets."""
    recording = recordings[window.recording]
    since = recording.time[window.start] - recording.time[0]
    if initial_states.has_encoder_offsets(recording.metadata) and since < initial_states.SETTLING:
        return False
    state = recording.array("position")[window.start], recording.array("velocity")[window.start]
    return bool(np.isfinite(state).all()) or recording.has("position_estimate")


def _unscored(recordings: Sequence[Recording]) -> float:
    """Return the beginning of each recording that does not count in closed loop, s."""
    return min(_UNSCORED, 0.25 * min(r.duration for r in recordings))


RESTART = 0.5
"""Where a recording's torques are commanded there is no loop that holds the simulation to it; it
is started anew so often, s."""


@dataclass(frozen=True)
class Overlay:
    """One recording or part of one: its ``position``, rad, and ``torque``, N m."""

    recording: Recording
    restarted: bool
    measured: dict[str, Array]
    """What was measured and counts, (rows, 2), else NaN."""
    simulated: dict[str, Array]
    """By each hypothesis, (hypotheses, rows, 2)."""


def overlays(
    recordings: Sequence[Recording],
    hypotheses: Sequence[parameters.LegHypothesis],
    threads: int = 0,
) -> list[Overlay]:
    """Simulate recordings, best those that no fit has seen, with hypotheses to compare."""
    skip, drawn = _unscored(recordings), []
    for recording in recordings:
        restarted = recording.metadata.onboard == "torque"
        length, unscored = (RESTART, 0.0) if restarted else (None, skip)
        windows = cut([recording], length, unscored=unscored)
        simulator = WindowSimulator([recording], windows, threads=threads)
        simulated = simulator.run(hypotheses)
        known, found = {}, {}
        for name in ("position", "torque"):
            values = np.concatenate([measured(simulator, name)[None], getattr(simulated, name)])
            rows = np.full((len(values), len(recording), 2), np.nan)
            for w, window in enumerate(windows):  # where they lie in the recording
                stop = window.start + window.length
                rows[:, window.start : stop] = values[:, w, : window.length]
            known[name], found[name] = rows[0], rows[1:]
        drawn.append(Overlay(recording, restarted, known, found))
    return drawn
