"""The control loop: one tick per period, at absolute deadlines, whatever the link does.

A tick asks both drives for their state, lets the sequence and then the supervisor decide, sends
the result at once and records everything. The question repeats the last command, so that a lost
frame costs one tick at most and the drives' watchdogs are fed twice a tick.
"""

import math
import threading
from dataclasses import dataclass

import numpy as np

from hopping_leg.deploy import telemetry
from hopping_leg.deploy.drive_link import BRAKE, STOP, DriveCommand, DriveLink, Exchange
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceStep
from hopping_leg.deploy.realtime import Clock
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.deploy.sample_buffer import SampleBuffer
from hopping_leg.deploy.stop_reasons import Operator, SupervisorInput
from hopping_leg.deploy.supervisor import State, SupervisorState, supervise

REPLY_SHARE = 0.7
"""Share of the period after which a tick goes on without the replies that are not in."""

_LEAST_WAIT = 0.3
"""Share of the period that replies get even in a tick that began late."""

_WARM_TICKS = 10
"""Ticks of listening before the operator's arming takes effect."""

_STOP_TICKS = 10
"""Ticks in which the drives are told to stop at the end."""


@dataclass(frozen=True)
class LoopOutcome:
    """How a run ended.

    Attributes:
        supervisor: Its last state.
        ticks: Done.
        skipped: Left out because the loop was late.
    """

    supervisor: SupervisorState
    ticks: int
    skipped: int


class ControlLoop:
    """Runs one sequence on one link, from arming to the end of stopping.

    Args:
        link: To the drives.
        sequence: What the leg does.
        limits: The supervisor's limits.
        recorder: Where everything is recorded.
        clock: The time; shared with the link.
    """

    def __init__(
        self,
        link: DriveLink,
        sequence: MotionSequence,
        limits: SafetyLimits,
        recorder: FlightRecorder,
        clock: Clock,
    ) -> None:
        self._link, self._sequence, self._limits = link, sequence, limits
        self._recorder, self._clock = recorder, clock
        self._samples = SampleBuffer(limits.period)
        self._internals = telemetry.internal_names(sequence.controller)
        self._stop, self._complaint = threading.Event(), ""

    def stop(self) -> None:
        """Ask for a stop on the operator's behalf; may be called from anywhere."""
        self._stop.set()

    def run(self) -> LoopOutcome:
        """Arm, run the sequence, damp, stop; return when the drives have been told to stop."""
        start = self._clock.now() + self._limits.period
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
        step = self._step(tick, deadline)
        seen = SupervisorInput(
            deadline,
            woke - deadline + skipped * period,
            exchange.replies,
            None if self._complaint else step.torque,
            self._operator(tick, state),
            self._sequence.finished,
        )
        after, outgoing = supervise(self._limits, state, seen)
        if outgoing != held:
            self._link.send(outgoing)
        sent = clock.now()
        if after.state is not state.state:
            self._note(after, deadline - start)
        timings = (woke - deadline, replied - woke, sent - replied, sent - deadline, skipped)
        self._recorder.row(
            telemetry.row(
                deadline - start,
                step,
                after,
                outgoing,
                exchange.replies,
                timings,
                self._own_columns(step),
            )
        )
        return after, outgoing

    def _remember(self, tick: int, deadline: float, exchange: Exchange) -> None:
        for joint, reply in enumerate(exchange.replies):
            if reply is not None:
                self._samples.put(tick, joint, reply)
        for joint, reply in exchange.late:
            ago = math.ceil((deadline - reply.taken) / self._limits.period)
            if ago > 0:
                self._samples.put(tick - ago, joint, reply)

    def _step(self, tick: int, time: float) -> SequenceStep:
        """Ask the sequence; an error of the controller becomes a complaint, never a crash."""
        sequence = self._sequence
        if self._complaint:
            return SequenceStep((0.0, 0.0), sequence.command(time), Part.DONE)
        try:
            measurement = None
            if self._samples.complete():
                measurement = self._samples.measurement(tick, sequence.command(time))
            return sequence.step(time, measurement)
        except Exception as error:
            self._complaint = f"{type(error).__name__}: {error}"
            self._recorder.event(time_s=time, controller_error=self._complaint)
            return SequenceStep((0.0, 0.0), sequence.command(time), Part.DONE)

    def _operator(self, tick: int, state: SupervisorState) -> Operator:
        if self._stop.is_set():
            return Operator.STOP
        if state.state is State.DISARMED and tick >= _WARM_TICKS:
            return Operator.ARM
        return Operator.NOTHING

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

    def _own_columns(self, step: SequenceStep) -> list[float]:
        if step.phase is not Part.HOP or self._complaint:
            return [math.nan] * len(self._internals)
        internals = self._sequence.controller.internals()
        return [float(internals[name][0]) for name in self._internals]
