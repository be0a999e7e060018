"""The control loop: one tick per period, at absolute deadlines, whatever the link does.

A tick asks both drives for their state, lets the sequence and then the supervisor decide, sends
the result at once and records everything. The question repeats the last command, so that a lost
frame costs one tick at most and the drives' watchdogs are fed twice a tick.
"""

import math
import threading
import traceback
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hopping_leg.controllers.fallback import Fallback
from hopping_leg.controllers.protocol import SAMPLES, Controller, Measurement
from hopping_leg.deploy import flight_recorder, realtime, safety_limits, stop_reasons
from hopping_leg.deploy.drive_link import BRAKE, STOP, DriveCommand, Exchange, Reply
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceStep
from hopping_leg.deploy.supervisor import State, SupervisorState, supervise
from hopping_leg.errors import ControllerError
from hopping_leg.robot.parameters import JOINTS

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink

REPLY_SHARE = 0.7
"""Share of the period after which a tick goes on without the replies that are not in."""

_LEAST_WAIT = 0.3  # Share of the period that replies get even in a tick that began late
_WARM_TICKS = 10  # Ticks of listening before the operator's arming takes effect
_STOP_TICKS = 10  # Ticks in which the drives are told to stop at the end
_REMEMBERED = 16  # Ticks; older samples are forgotten
_LOOP = ("time_s", "command_m", "state", "reason", "part", "action")
_HEIGHTS = ("height_m", "foot_clearance_m")
_TIMES = ("wake_late_s", "exchange_s", "control_s", "tick_s", "skipped_ticks")
_MEASURED = ("position", "velocity", "torque")
_DRIVE = ("mode", "fault", "voltage", "temperature")
_DRIVE_COLUMNS = (
    *("position_rad", "velocity_rad_s", "torque_nm", "mode", "fault", "voltage_v"),
    *("temperature_c", "fresh", "command_nm", "sent_nm"),
)


def columns(controller: Controller) -> tuple[str, ...]:
    """Return a recording's columns; ControllerError where a controller names one of the loop's."""
    drives = tuple(f"{joint}_{name}" for name in _DRIVE_COLUMNS for joint in JOINTS)
    names, own = (*_LOOP, *_HEIGHTS, *_TIMES, *drives), _internal_names(controller)
    if taken := sorted({*names} & {*own}):
        raise ControllerError(
            f"'internals' of controller '{controller.name}' names '{taken[0]}', which every run"
            " has; choose another name."
        )
    return (*names, *own)


def _internal_names(controller: Controller) -> list[str]:
    controller.reset(1)
    return sorted(controller.internals())


class SampleBuffer:
    """The recent past of both joints, by tick.

    A sample counts once both drives have sent it. Its age is that of the tick that asked for it,
    so that a sample of this tick has age zero, as in simulation; a reply that arrives late is put
    where it belongs, and a tick without one shows older samples with their ages.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._ticks: dict[int, list[Reply | None]] = {}
        self._commands: dict[int, float] = {}

    def put(self, tick: int, joint: int, reply: Reply) -> None:
        """Record a reply to a tick's question."""
        self._ticks.setdefault(tick, [None, None])[joint] = reply
        for old in [t for t in self._ticks if t <= tick - _REMEMBERED]:
            del self._ticks[old]
            self._commands.pop(old, None)

    def measurement(self, tick: int, command: float) -> Measurement | None:
        """Return what a controller sees at a tick; None before any has samples of both joints."""
        newest = sorted((t for t in self._ticks if t <= tick and all(self._ticks[t])), reverse=True)
        if not newest:
            return None
        self._commands[tick] = command
        newest = [*newest[:SAMPLES], *newest[-1:] * (SAMPLES - len(newest))]
        chosen = [[reply for reply in self._ticks[t] if reply] for t in newest]
        return Measurement(
            q=np.array([[[reply.position for reply in pair] for pair in chosen]]),
            qd=np.array([[[reply.velocity for reply in pair] for pair in chosen]]),
            command=np.array([[self._commands.get(t, command) for t in newest]]),
            age=np.array([[(tick - t) * self._period for t in newest]]),
        )


@dataclass(frozen=True)
class LoopOutcome:
    """How a run ended."""

    supervisor: SupervisorState
    ticks: int
    """Done."""
    skipped: int
    """Left out because the loop was late."""


class ControlLoop:
    """Runs one sequence on one link, from arming to the end of stopping, and records everything."""

    def __init__(
        self,
        link: "MoteusLink",
        sequence: MotionSequence,
        limits: safety_limits.SafetyLimits,
        recorder: flight_recorder.FlightRecorder,
        clock: realtime.Clock,
    ) -> None:
        self._link, self._sequence, self._limits = link, sequence, limits
        self._recorder, self._clock = recorder, clock
        self._samples = SampleBuffer(limits.period)
        self._internals = _internal_names(sequence.controller)
        self._stop, self._complaint = threading.Event(), ""
        self._asked, self._took, self._abandoned = math.inf, 0.0, False
        self._start = 0.0
        sequence.report = lambda findings: self._note_asked(squat=asdict(findings))
        if isinstance(sequence.controller, Fallback):
            sequence.controller.report = lambda why: self._note_asked(fallback=why)

    @property
    def waited(self) -> float:
        """How long the controller has kept the loop waiting, s; any thread may ask."""
        return max(self._clock.now() - self._asked, 0.0)

    def stop(self) -> None:
        """Ask for a stop on the operator's behalf; may be called from anywhere."""
        self._stop.set()

    def abandon(self) -> None:
        """Brake from another thread; if the controller returns after all, the loop only ends."""
        self._abandoned = True
        self._link.send(BRAKE)

    def run(self) -> LoopOutcome:
        """Arm, run the sequence, damp, stop; return when the drives have been told to stop."""
        start = self._start = self._clock.now() + self._limits.period
        state, held = SupervisorState(since=start), STOP
        tick = ticks = skipped = stops_sent = 0
        stepped = 1
        try:
            while stops_sent < _STOP_TICKS:
                state, held = self._tick(start, tick, stepped - 1, state, held)
                stops_sent = stops_sent + 1 if state.state is State.STOPPED else 0
                ticks, skipped = ticks + 1, skipped + stepped - 1
                behind = (self._clock.now() - start) / self._limits.period
                following = max(tick + 1, math.floor(behind))
                tick, stepped = following, following - tick
        finally:
            if stops_sent < _STOP_TICKS:
                self._link.send(BRAKE)
        return LoopOutcome(state, ticks, skipped)

    def _tick(
        self, start: float, tick: int, skipped: int, state: SupervisorState, held: DriveCommand
    ) -> tuple[SupervisorState, DriveCommand]:
        period, clock = self._limits.period, self._clock
        deadline = start + tick * period
        woke = clock.wait_until(deadline)
        until = max(deadline + REPLY_SHARE * period, woke + _LEAST_WAIT * period)
        exchange = self._link.exchange(held, until)
        replied = clock.now()
        self._remember(tick, deadline, exchange)
        took = self._took
        step, internals = self._step(tick, deadline, over=state.state > State.RUNNING)
        arms = state.state is State.DISARMED and tick >= _WARM_TICKS
        operator = stop_reasons.Operator.ARM if arms else stop_reasons.Operator.NOTHING
        seen = stop_reasons.SupervisorInput(
            deadline,
            woke - deadline + skipped * period,
            exchange.replies,
            None if self._complaint else step.torque,
            stop_reasons.Operator.STOP if self._stop.is_set() else operator,
            self._sequence.finished,
            took,
            step.trouble,
        )
        after, outgoing = supervise(self._limits, state, seen)
        if outgoing != held:
            self._link.send(outgoing)
        sent = clock.now()
        if after.state is not state.state:
            self._note(after, deadline - start)
        timings = (woke - deadline, replied - woke, sent - replied, sent - deadline, skipped)
        self._record(deadline - start, step, internals, after, outgoing, exchange, timings)
        return after, outgoing

    def _record(
        self,
        time: float,
        step: SequenceStep,
        internals: list[float],
        after: SupervisorState,
        outgoing: DriveCommand,
        exchange: Exchange,
        timings: tuple[float, ...],
    ) -> None:
        """Record the row of a tick; measurements are NaN where no fresh reply came."""
        fresh, last = exchange.replies, after.counts.last
        parts = (after.state, after.cause.reason, step.phase, outgoing.action.value)
        values = [time, step.command, *parts, exchange.height, exchange.clearance, *timings]
        for replies, names in ((fresh, _MEASURED), (last, _DRIVE)):
            values += [getattr(reply, name, math.nan) for name in names for reply in replies]
        values += [float(reply is not None) for reply in fresh]
        self._recorder.row([*values, *step.controller, *outgoing.torque, *internals])

    def _remember(self, tick: int, deadline: float, exchange: Exchange) -> None:
        for joint, reply in enumerate(exchange.replies):
            if reply is not None:
                self._samples.put(tick, joint, reply)
        for joint, reply in exchange.late:
            ago = math.ceil((deadline - reply.taken) / self._limits.period)
            if ago > 0:
                self._samples.put(tick - ago, joint, reply)

    def _step(self, tick: int, time: float, *, over: bool) -> tuple[SequenceStep, list[float]]:
        """Ask for a step and what is to be recorded; an error is a complaint."""
        command = self._sequence.command(time)
        unknown = [math.nan] * len(self._internals)
        if over or self._complaint:
            return SequenceStep((0.0, 0.0), command, Part.DONE), unknown
        self._asked = self._clock.now()
        try:
            step = self._sequence.step(time, self._samples.measurement(tick, command))
            return step, self._read_internals() if step.phase is Part.HOP else unknown
        except BaseException as error:  # also SystemExit: nothing but the supervisor ends a run
            self._complaint = traceback.format_exception_only(error)[-1].strip()
            if isinstance(error, ControllerError):
                self._complaint = str(error)
            self._recorder.event(time_s=time - self._start, controller_error=self._complaint)
            return SequenceStep((0.0, 0.0), command, Part.DONE), unknown
        finally:
            self._took, self._asked = self.waited, math.inf
            if self._abandoned:
                raise SystemExit

    def _note_asked(self, **facts: Any) -> None:  # noqa: ANN401
        self._recorder.event(time_s=self._asked - self._start, **facts)

    def _read_internals(self) -> list[float]:
        found = self._sequence.controller.internals()
        if sorted(found) != self._internals:
            raise ControllerError(
                f"'internals' of controller '{self._sequence.controller.name}' names"
                f" {sorted(found)} but named {self._internals} at first; always name the same."
            )
        return [float(np.ravel(found[name])[0]) for name in self._internals]

    def _note(self, state: SupervisorState, time: float) -> None:
        """Record a transition; begin the sequence with it."""
        self._recorder.event(
            time_s=time,
            state=state.state.name.lower(),
            reason=state.cause.reason.name.lower(),
            sentence=str(state.cause),
        )
        if state.state is State.RUNNING:
            posture = np.array([reply.position for reply in state.counts.last if reply])
            self._sequence.begin(state.since, posture)
