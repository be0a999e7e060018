"""Trials of a robot of which nothing is known but what it measures.

In a trial a controller hops for a limited time through a schedule of heights, and what comes back
is a trace. The simulated twin and the drives behind a wire are both reached like this.
"""

from dataclasses import dataclass
from typing import Protocol

import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, protocol
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class HardwareTrial:
    """What came back.

    Attributes:
        trace: What was measured and asked for while the controller had the leg, one row per control
            period: the trace's joint positions, velocities and torques are the measured ones, NaN
            where no sample arrived.
        seconds: For which the robot was in use.
        complaint: Why it was ended early, a sentence; empty if it was not.
        truth: Time, command and height of every true apex, s, m, m, (hops, 3), for those who judge;
            None where nobody knows. Learners must not look.
    """

    trace: Trace
    seconds: float
    complaint: str = ""
    truth: Array | None = None


class TrialRobot(Protocol):
    """A robot on which controllers can be tried."""

    @property
    def name(self) -> str:
        """Name of the robot."""
        ...

    def hop(
        self, controller: protocol.Controller, schedule: command_schedule.CommandSchedule, seed: int
    ) -> HardwareTrial:
        """Let a controller hop from standing; ``seed`` is that of the trial's own randomness."""
        ...


MEASURED = {
    "q": ("hip_position_rad", "knee_position_rad"),
    "qd": ("hip_velocity_rad_s", "knee_velocity_rad_s"),
    "torque": ("hip_torque_nm", "knee_torque_nm"),
    "asked": ("hip_command_nm", "knee_command_nm"),
}
"""Quantities of both joints to their columns in the trace of a trial."""


def measured_table(time: Array, command: Array, joints: dict[str, Array]) -> pl.DataFrame:
    """Return a trial's table of s, m, (ticks,), and ``MEASURED`` quantities, (ticks, 2) each."""
    columns = {"time_s": time, "command_m": command}
    for name, values in joints.items():
        columns |= dict(zip(MEASURED[name], values.T, strict=True))
    return pl.DataFrame(columns)
