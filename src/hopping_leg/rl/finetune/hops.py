"""How well an outing's hops met their commands, as estimated and, on a twin, in truth."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.hardware_trial import HardwareTrial
from hopping_leg.rl.finetune.apex_estimate import ApexEstimate

SETTLING = 1.0
"""Time after a new command whose hops do not count, s."""

_FALLEN = 1.0
"""Error of an outing that was ended early, m."""


@dataclass(frozen=True)
class Score:
    """Of one outing.

    Attributes:
        by_command: Command to the median |apex - command|, m; the command itself without hops.
        offsets: Command to the median of apex - command, m.
        hops: That counted.
        error: Mean of ``by_command``, or one metre where the outing was ended early.
    """

    by_command: dict[float, float]
    offsets: dict[float, float]
    hops: int
    error: float


def estimated(outing: HardwareTrial, estimate: ApexEstimate) -> Array:
    """Return time, command and estimated height of an outing's apexes, s, m, m, (hops, 3)."""
    tick, height = estimate.apexes[0].T
    rows = tick.astype(np.int64)
    columns = (outing.trace.column(name)[rows] for name in ("time_s", "command_m"))
    begin = outing.trace.column("time_s")[0] if len(outing.trace.table) else 0.0
    time, command = columns
    return np.stack([time - begin, command, height], axis=1)


def settled(apexes: Array, schedule: CommandSchedule) -> Array:
    """Return the apexes that no change of the command disturbed, (hops, 3)."""
    switches = np.cumsum([0.0, *(seconds for _, seconds in schedule.steps)])
    since = apexes[:, :1] - switches[None, :]
    calm: Array = apexes[np.where(since >= 0, since, np.inf).min(axis=1) >= SETTLING]
    return calm


def score(apexes: Array, schedule: CommandSchedule, complaint: str) -> Score:
    """Return how well commands were met.

    Args:
        apexes: Time, command and height of every apex, (hops, 3).
        schedule: What was commanded.
        complaint: Why the outing was ended early, if it was.
    """
    counted = settled(apexes, schedule)
    errors, offsets = {}, {}
    for command in sorted(set(schedule.heights)):
        off = counted[np.isclose(counted[:, 1], command), 2] - command
        errors[command] = float(np.median(np.abs(off))) if len(off) else command
        offsets[command] = float(np.median(off)) if len(off) else -command
    error = _FALLEN if complaint else float(np.mean(list(errors.values())))
    return Score(errors, offsets, len(counted), error)
