"""Hardware trials: a run from a checked link to a trace on disk, and the legs that make them."""

import concurrent.futures
import datetime
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from hopping_leg.controllers import command_schedule, hardware_trial, protocol
from hopping_leg.controllers.policy import Policy
from hopping_leg.deploy import drive_link, flight_recorder, safety_limits, stop_reasons, supervisor
from hopping_leg.deploy.loop import ControlLoop, LoopOutcome, columns
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.realtime import Clock, RealClock, keeping_time
from hopping_leg.errors import HardwareError
from hopping_leg.io import safe_file_name, versions
from hopping_leg.robot import Robot, SoftLimits
from hopping_leg.trace import Trace

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink

_PACKAGES = ("hopping-leg", "numpy", "onnxruntime", "moteus", "python-can")
_CODES: dict[str, type[Enum]] = {
    "state": supervisor.State,
    "part": Part,
    "action": drive_link.Action,
    "reason": stop_reasons.Reason,
}


@dataclass(frozen=True)
class Performance:
    """A finished run, its trace, and where that lies on disk."""

    outcome: LoopOutcome
    trace: Trace
    path: Path
    notices: tuple[str, ...]
    """What the computer did not permit."""


def perform(
    link: "MoteusLink",
    sequence: MotionSequence,
    limits: safety_limits.SafetyLimits,
    path: Path,
    header: dict[str, Any],
    *,
    clock: Clock | None = None,
    realtime: bool = True,
    beside: Callable[[ControlLoop], AbstractContextManager[None]] = lambda _: nullcontext(),
) -> Performance:
    """Arm, run a sequence, stop; SIGINT and SIGTERM stop it as the operator would.

    Args:
        link: To drives that were found fit.
        sequence: What the leg does.
        limits: The supervisor's limits.
        path: File of the trace; the flight recording lies beside it as long as the run lasts.
        header: Header of the trace.
        clock: None takes the computer's.
        realtime: Ask for priority and locked memory.
        beside: Makes what is open while the loop runs, e.g. a keyboard that stops it.

    Raises:
        TraceError: The flight recording cannot be written.
    """
    recording = path.with_suffix(flight_recorder.SUFFIX)
    recorder = flight_recorder.FlightRecorder(recording, columns(sequence.controller), header)
    loop = ControlLoop(link, sequence, limits, recorder, clock or RealClock())
    notices: tuple[str, ...] = ()
    try:
        with (
            _stopped_by_signals(loop),
            beside(loop),
            keeping_time(realtime=realtime) as notices,
            concurrent.futures.ThreadPoolExecutor(1, "control-loop") as threads,
        ):
            # Signals reach this thread while it waits for the loop's.
            outcome = threads.submit(loop.run).result()
    finally:
        if link.trouble:
            recorder.event(link_trouble=link.trouble)
        recorder.close()
    trace = flight_recorder.recover(recording)
    trace.save(path)
    recording.unlink()
    return Performance(outcome, trace, path, notices)


def header_of(
    robot: Robot,
    controller: protocol.Controller,
    rate: float,
    **facts: Any,  # noqa: ANN401
) -> dict[str, Any]:
    """Return a trace's header: what ran on what, and what its codes mean."""
    policy = {"policy_digest": controller.digest} if isinstance(controller, Policy) else {}
    return {
        "robot": robot.name,
        "robot_digest": robot.digest,
        "controller": controller.name,
        **policy,
        "rate_hz": rate,
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": versions(*_PACKAGES),
        "codes": {
            name: {str(member.value): member.name.lower() for member in kind}
            for name, kind in _CODES.items()
        },
        **facts,
    }


def new_path(folder: Path, name: str) -> Path:
    """Return a trace's path that no earlier run has."""
    safe = safe_file_name(name)
    stamp = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S")
    path, count = folder / f"{safe}-{stamp}.parquet", 1
    while path.exists() or path.with_suffix(flight_recorder.SUFFIX).exists():
        count += 1
        path = folder / f"{safe}-{stamp}-{count}.parquet"
    return path


@contextmanager
def _stopped_by_signals(loop: ControlLoop) -> Iterator[None]:
    """Let SIGINT and SIGTERM stop the leg; outside of the main thread there are none."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: loop.stop())
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@dataclass(frozen=True)
class DeployedRobot:
    """A leg behind a wire; implements ``TrialRobot``.

    Attributes:
        robot: As its file says.
        rate: Control rate, Hz.
        folder: For the whole traces.
        connect: Opens the link to its drives for one trial.
        check: Refuses drives that are not fit; returns what was found, for the trace.
        ready: Called before every trial; returns once the operator agrees.
        clock: The time; none takes the computer's.
    """

    robot: Robot
    rate: float
    folder: Path
    connect: Callable[[], AbstractContextManager["MoteusLink"]]
    check: Callable[["MoteusLink"], dict[str, Any]]
    ready: Callable[[float], None]
    clock: Clock | None = None

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.robot.name

    def hop(
        self, controller: protocol.Controller, schedule: command_schedule.CommandSchedule, seed: int
    ) -> hardware_trial.HardwareTrial:
        """Let a controller hop from standing.

        Raises:
            HardwareError: The operator stopped the leg, or it was stopped before it hopped.
        """
        sequence = MotionSequence(
            controller,
            schedule,
            hopping_poses(self.robot),
            protocol.SoftLimiter(self.robot, SoftLimits()),
            SequenceTiming(hop=schedule.seconds),
        )
        with self.connect() as link:
            found = self.check(link)
            self.ready(schedule.seconds)
            done = perform(
                link,
                sequence,
                safety_limits.hopping_limits(self.robot, self.rate),
                new_path(self.folder, controller.name),
                header_of(self.robot, controller, self.rate, drives=found, outing_seed=seed),
                clock=self.clock,
                realtime=self.clock is None,
            )
        cause = done.outcome.supervisor.stop_cause
        if cause.reason is stop_reasons.Reason.OPERATOR_STOP:
            raise HardwareError("You stopped the leg; the same command with --resume goes on.")
        table = done.trace.table
        hopped = table.filter(
            pl.col("part") == Part.HOP, pl.col("state") == supervisor.State.RUNNING
        )
        if hopped.height < self.rate:
            raise HardwareError(f"The leg was stopped before it hopped: {cause}")
        complaint = "" if cause.reason is stop_reasons.Reason.FINISHED else str(cause)
        return hardware_trial.HardwareTrial(
            Trace(hopped, done.trace.header), table.height / self.rate, complaint
        )
