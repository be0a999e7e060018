"""Outings of a leg on real, or emulated, drives: what ``hop deploy`` does, once per outing.

The leg rises, hops, sinks down and is disarmed; the supervisor's limits hold all the while. What
comes back is the part of the trace in which the controller had the leg.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from hopping_leg.controllers.hardware_trial import HardwareTrial, Steps
from hopping_leg.controllers.protocol import Controller
from hopping_leg.deploy.clock import Clock
from hopping_leg.deploy.driver import MoteusLink
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.schedule import Schedule
from hopping_leg.deploy.session import header_of, new_path, perform
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.deploy.supervisor import State
from hopping_leg.errors import HardwareError
from hopping_leg.robot.limits import SoftLimiter, SoftLimits
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class Deployed:
    """A leg behind a wire; implements ``TrialRobot``.

    Attributes:
        robot: As its file says.
        rate: Control rate, Hz.
        folder: For the whole traces.
        connect: Opens the link to its drives for one outing.
        check: Refuses drives that are not fit; returns what was found, for the trace.
        ready: Called before every outing; returns once the operator agrees.
        clock: The time; none takes the computer's.
    """

    robot: Robot
    rate: float
    folder: Path
    connect: Callable[[], AbstractContextManager[MoteusLink]]
    check: Callable[[MoteusLink], dict[str, Any]]
    ready: Callable[[float], None]
    clock: Clock | None = None

    @property
    def name(self) -> str:
        """Of the robot."""
        return self.robot.name

    def hop(self, controller: Controller, steps: Steps, seed: int) -> HardwareTrial:
        """Let a controller hop from standing.

        Raises:
            HardwareError: The operator stopped the leg, or it was stopped before it hopped.
        """
        schedule = Schedule(steps)
        sequence = MotionSequence(
            controller,
            schedule,
            hopping_poses(self.robot),
            SoftLimiter(self.robot, SoftLimits()),
            SequenceTiming(hop=schedule.seconds),
        )
        with self.connect() as link:
            found = self.check(link)
            self.ready(schedule.seconds)
            done = perform(
                link,
                sequence,
                hopping_limits(self.robot, self.rate),
                new_path(self.folder, controller.name),
                header_of(self.robot, controller, self.rate, drives=found, outing_seed=seed),
                clock=self.clock,
                realtime=self.clock is None,
            )
        cause = done.outcome.supervisor.stop_cause
        if cause.reason is Reason.OPERATOR_STOP:
            raise HardwareError("You stopped the leg; the same command with --resume goes on.")
        table = done.trace.table
        hopping = (pl.col("part") == Part.HOP) & (pl.col("state") == State.RUNNING)
        hopped = table.filter(hopping)
        if hopped.height < self.rate:
            raise HardwareError(f"The leg was stopped before it hopped: {cause}")
        complaint = "" if cause.reason is Reason.FINISHED else str(cause)
        return HardwareTrial(Trace(hopped, done.trace.header), table.height / self.rate, complaint)
