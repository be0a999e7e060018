"""What trials measured, what is estimated of their hops, and how well those met the commands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, hardware_trial
from hopping_leg.errors import TraceError
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class TrialData:
    """What n trials of the same length measured; samples that did not arrive are NaN."""

    q: Array
    """Joint positions, rad, (ticks, n, 2)."""
    qd: Array
    """Joint velocities, rad/s, (ticks, n, 2)."""
    torque: Array
    """Measured joint torques, N m, (ticks, n, 2)."""
    command: Array
    """Desired height, m, (ticks, n)."""
    period: float
    """Control period, s."""

    @staticmethod
    def of(traces: Sequence[Trace]) -> "TrialData":
        """Return equally long traces as arrays; ``TraceError`` without columns or samples."""
        joints = {
            name: np.stack(
                [
                    np.stack([t.column(c) for c in hardware_trial.MEASURED[name]], axis=1)
                    for t in traces
                ],
                axis=1,
            )
            for name in ("q", "qd", "torque")
        }
        if np.isnan(joints["q"]).all(axis=(0, 2)).any():
            raise TraceError("A trace of a trial holds no sample of the joints; it tells nothing.")
        command = np.stack([trace.column("command_m") for trace in traces], axis=1)
        return TrialData(**joints, command=command, period=1 / traces[0].header["rate_hz"])

    @property
    def ticks(self) -> int:
        """Control periods."""
        return len(self.command)

    def filled(self) -> Array:
        """Return q, qd and torque with gaps held, (ticks, n, 6); what comes first fills back."""
        joined = np.concatenate([self.q, self.qd, self.torque], axis=-1)
        place = np.where(np.isfinite(joined), np.arange(self.ticks)[:, None, None], -1)
        last = np.maximum.accumulate(place, axis=0)
        first = np.where(place >= 0, place, self.ticks).min(axis=0)
        held: Array = np.take_along_axis(joined, np.where(last < 0, first, last), axis=0)
        return held


SETTLING = 1.0
"""Time after a new command whose hops do not count, s."""

_FALLEN = 1.0
"""Error of a trial that was ended early, m."""


@dataclass(frozen=True)
class Score:
    """How well one trial met its commands."""

    by_command: dict[float, float]
    """Command to the median |apex - command|, m; the command itself without hops."""
    offsets: dict[float, float]
    """Command to the median of apex - command, m."""
    hops_at: dict[float, int]
    """Command to its hops that counted."""
    error: float
    """Mean of ``by_command``, or one metre where the trial was ended early."""

    @property
    def hops(self) -> int:
        """Hops that counted."""
        return sum(self.hops_at.values())


def estimated(trial: hardware_trial.HardwareTrial, apexes: Array) -> Array:
    """Return time, command and height, s, m, m, (hops, 3), of apexes of tick and height."""
    rows = apexes[:, 0].astype(np.int64)
    time, command = (trial.trace.column(name) for name in ("time_s", "command_m"))
    return np.stack([time[rows] - time[0], command[rows], apexes[:, 1]], axis=1)


def settled(apexes: Array, schedule: command_schedule.CommandSchedule) -> Array:
    """Return the apexes that no change of the command disturbed, (hops, 3)."""
    since = apexes[:, :1] - np.cumsum([0.0, *(seconds for _, seconds in schedule.steps)])
    calm: Array = apexes[np.where(since >= 0, since, np.inf).min(axis=1) >= SETTLING]
    return calm


def score(apexes: Array, schedule: command_schedule.CommandSchedule, complaint: str) -> Score:
    """Return how well commands were met by apexes of time, command and height, (hops, 3).

    A complaint says why the trial was ended early, if it was.
    """
    counted = settled(apexes, schedule)
    errors, offsets, hops = {}, {}, {}
    for command in sorted(set(schedule.heights)):
        off = counted[np.isclose(counted[:, 1], command), 2] - command
        hops[command] = len(off)
        errors[command] = float(np.median(np.abs(off))) if len(off) else command
        offsets[command] = float(np.median(off)) if len(off) else -command
    error = _FALLEN if complaint else float(np.mean(list(errors.values())))
    return Score(errors, offsets, hops, error)
