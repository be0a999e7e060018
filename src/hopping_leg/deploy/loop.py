"""The control loop: one tick per period, at absolute deadlines, whatever the link does.

A tick asks both drives for their state, lets the sequence and then the supervisor decide, sends
the result at once and records everything. The question repeats the last command, so that a lost
frame costs one tick at most and the drives' watchdogs are fed twice a tick.
"""

import math
import threading
from dataclasses import dataclass

import numpy as np

from hopping_leg.deploy import rows
from hopping_leg.deploy.black_box import BlackBox
from hopping_leg.deploy.clock import Clock
from hopping_leg.deploy.envelope import Envelope
from hopping_leg.deploy.link import Exchange, Link
from hopping_leg.deploy.observation import BRAKE, STOP, Observation, Operator, Outgoing
from hopping_leg.deploy.samples import Samples
from hopping_leg.deploy.sequence import Phase, Sequence, Step
from hopping_leg.deploy.supervisor import Memory, State, supervise

REPLY_SHARE = 0.7
"""Share of the period after which a tick goes on without the replies that are not in."""

_LEAST_WAIT = 0.3
"""Share of the period that replies get even in a tick that began late."""

_WARM_TICKS = 10
"""Ticks of listening before the operator's arming takes effect."""

_STOP_TICKS = 10
"""Ticks in which the drives are told to stop at the end."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        memory: Of the supervisor.
        ticks: Done.
        skipped: Left out because the loop was late.
    """

    memory: Memory
    ticks: int
    skipped: int


class ControlLoop:
    """Runs one sequence on one link, from arming to the end of stopping.

    Args:
        link: To the drives.
        sequence: What the leg does.
        envelope: The supervisor's limits.
        box: Where everything is recorded.
        clock: The time; shared with the link.
    """

    def __init__(
        self, link: Link, sequence: Sequence, envelope: Envelope, box: BlackBox, clock: Clock
    ) -> None:
        self._link, self._sequence, self._envelope = link, sequence, envelope
        self._box, self._clock = box, clock
        self._samples = Samples(envelope.period)
        self._internals = rows.internal_names(sequence.controller)
        self._stop, self._complaint = threading.Event(), ""

    def stop(self) -> None:
        """Ask for a stop on the operator's behalf; may be called from anywhere."""
        self._stop.set()

    def run(self) -> Outcome:
        """Arm, run the sequence, damp, stop; return when the drives have been told to stop."""
        start = self._clock.now() + self._envelope.period
        memory, held = Memory(since=start), STOP
        tick = ticks = skipped = told = 0
        stepped = 1
        try:
            while told < _STOP_TICKS:
                memory, held = self._tick(start, tick, stepped - 1, memory, held)
                told = told + 1 if memory.state is State.STOPPED else 0
                ticks, skipped = ticks + 1, skipped + stepped - 1
                behind = (self._clock.now() - start) / self._envelope.period
                following = max(tick + 1, math.floor(behind))
                tick, stepped = following, following - tick
        finally:
            if told < _STOP_TICKS:
                self._link.send(BRAKE)
        return Outcome(memory, ticks, skipped)

    def _tick(
        self, start: float, tick: int, skipped: int, memory: Memory, held: Outgoing
    ) -> tuple[Memory, Outgoing]:
        period, clock = self._envelope.period, self._clock
        deadline = start + tick * period
        woke = clock.wait_until(deadline)
        until = max(deadline + REPLY_SHARE * period, woke + _LEAST_WAIT * period)
        exchange = self._link.exchange(held, until)
        replied = clock.now()
        self._remember(tick, deadline, exchange)
        step = self._step(tick, deadline)
        seen = Observation(
            deadline,
            woke - deadline + skipped * period,
            exchange.replies,
            None if self._complaint else step.torque,
            self._operator(tick, memory),
            self._sequence.finished,
        )
        after, outgoing = supervise(self._envelope, memory, seen)
        if outgoing != held:
            self._link.send(outgoing)
        sent = clock.now()
        if after.state is not memory.state:
            self._note(after, deadline - start)
        timings = rows.Timings(
            woke - deadline, replied - woke, sent - replied, sent - deadline, skipped
        )
        self._box.row(
            rows.row(
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
            ago = math.ceil((deadline - reply.taken) / self._envelope.period)
            if ago > 0:
                self._samples.put(tick - ago, joint, reply)

    def _step(self, tick: int, time: float) -> Step:
        """Ask the sequence; an error of the controller becomes a complaint, never a crash."""
        sequence = self._sequence
        if self._complaint:
            return Step((0.0, 0.0), sequence.command(time), Phase.DONE)
        try:
            measurement = None
            if self._samples.complete():
                measurement = self._samples.measurement(tick, sequence.command(time))
            return sequence.step(time, measurement)
        except Exception as error:
            self._complaint = f"{type(error).__name__}: {error}"
            self._box.event(time_s=time, controller_error=self._complaint)
            return Step((0.0, 0.0), sequence.command(time), Phase.DONE)

    def _operator(self, tick: int, memory: Memory) -> Operator:
        if self._stop.is_set():
            return Operator.STOP
        if memory.state is State.DISARMED and tick >= _WARM_TICKS:
            return Operator.ARM
        return Operator.NO_NOISE

    def _note(self, memory: Memory, time: float) -> None:
        """Record a transition; begin the sequence with it."""
        self._box.event(
            time_s=time,
            state=memory.state.name.lower(),
            reason=memory.cause.reason.name.lower(),
            sentence=str(memory.cause),
        )
        if memory.state is State.RUNNING:
            posture = np.array([reply.position for reply in memory.counts.last if reply])
            self._sequence.begin(memory.since, posture)

    def _own_columns(self, step: Step) -> list[float]:
        if step.phase is not Phase.HOP or self._complaint:
            return [math.nan] * len(self._internals)
        internals = self._sequence.controller.internals()
        return [float(internals[name][0]) for name in self._internals]
