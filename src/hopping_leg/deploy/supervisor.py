"""The safety supervisor: a pure function of what is seen, which decides what leaves for the drives.

    disarmed --operator--> arming --drives ready--> running --any cause--> damping --rest--> stopped
                              |                                              ^                  |
                              +----------------- any cause ------------------+     <--operator--+

An operator's stop leads from ``disarmed`` straight to ``stopped``. Torques leave in ``running``
alone, clipped to the limits. From ``damping`` on nothing but the operator leads back: a stop is
latched.
"""

from dataclasses import dataclass
from enum import IntEnum

from hopping_leg.deploy.checks import Cause, Counts, find_cause
from hopping_leg.deploy.envelope import Envelope
from hopping_leg.deploy.observation import (
    BRAKE,
    LIMP,
    STOP,
    Action,
    DriveMode,
    Observation,
    Operator,
    Outgoing,
    Pair,
)
from hopping_leg.deploy.reasons import Reason


class State(IntEnum):
    """What the supervisor lets happen."""

    DISARMED = 0
    ARMING = 1
    RUNNING = 2
    DAMPING = 3
    STOPPED = 4


_NOTHING_YET = Cause(Reason.NONE)
_NO_COUNTS = Counts()


@dataclass(frozen=True, slots=True)
class Memory:
    """All that the supervisor remembers from tick to tick.

    Attributes:
        state: Now.
        since: When it was entered, s.
        cause: Of the last transition.
        stop_cause: Of the last transition into ``damping``.
        counts: What only several ticks together tell.
    """

    state: State = State.DISARMED
    since: float = 0.0
    cause: Cause = _NOTHING_YET
    stop_cause: Cause = _NOTHING_YET
    counts: Counts = _NO_COUNTS


def supervise(envelope: Envelope, memory: Memory, seen: Observation) -> tuple[Memory, Outgoing]:
    """Decide a tick.

    Args:
        envelope: The limits.
        memory: From the last tick.
        seen: At this tick.

    Returns:
        What to remember and what may leave: always finite and within the limits.
    """
    counts = memory.counts.after(envelope, seen)
    state, cause = _next(envelope, memory, counts, seen)
    if state is memory.state:
        memory = Memory(state, memory.since, memory.cause, memory.stop_cause, counts)
    else:
        stop_cause = cause if state is State.DAMPING else memory.stop_cause
        memory = Memory(state, seen.time, cause, stop_cause, counts)
    return memory, _outgoing(envelope, state, seen)


def _next(
    envelope: Envelope, memory: Memory, counts: Counts, seen: Observation
) -> tuple[State, Cause]:
    """Return the state after a tick and the cause of the change, if it is one."""
    match memory.state:
        case State.DISARMED | State.STOPPED:
            if seen.operator is Operator.ARM:
                return State.ARMING, Cause(Reason.OPERATOR_ARMED)
            if seen.operator is Operator.STOP and memory.state is State.DISARMED:
                return State.STOPPED, Cause(Reason.OPERATOR_STOP)
        case State.DAMPING:
            return _calm_down(envelope, memory, seen)
        case State.ARMING | State.RUNNING:
            arming = memory.state is State.ARMING
            if seen.operator is Operator.STOP:
                return State.DAMPING, Cause(Reason.OPERATOR_STOP)
            found = find_cause(envelope, memory.counts, counts, seen, arming=arming)
            if found is not None:
                return State.DAMPING, found
            if arming:
                return _arm(envelope, memory, seen)
            if seen.finished:
                return State.DAMPING, Cause(Reason.FINISHED)
    return memory.state, memory.cause


def _arm(envelope: Envelope, memory: Memory, seen: Observation) -> tuple[State, Cause]:
    if all(reply is not None and reply.mode == DriveMode.TORQUE for reply in seen.replies):
        return State.RUNNING, Cause(Reason.DRIVES_READY)
    if not seen.time - memory.since <= envelope.arming_time:
        return State.DAMPING, Cause(Reason.ARMING_TOOK_TOO_LONG)
    return State.ARMING, memory.cause


def _calm_down(envelope: Envelope, memory: Memory, seen: Observation) -> tuple[State, Cause]:
    elapsed = seen.time - memory.since
    resting = all(
        reply is not None and abs(reply.velocity) <= envelope.rest_speed for reply in seen.replies
    )
    if resting and elapsed >= envelope.damping_least:
        return State.STOPPED, Cause(Reason.CAME_TO_REST)
    if not elapsed <= envelope.damping_most:
        return State.STOPPED, Cause(Reason.DAMPED_LONG_ENOUGH)
    return State.DAMPING, memory.cause


def _outgoing(envelope: Envelope, state: State, seen: Observation) -> Outgoing:
    match state:
        case State.ARMING:
            return LIMP
        case State.RUNNING if seen.wanted is not None:
            return Outgoing(Action.TORQUE, _clip(seen.wanted, envelope.torque))
        case State.DAMPING:
            return BRAKE
    return STOP


def _clip(torque: Pair, limit: Pair) -> Pair:
    hip, knee = (max(-most, min(most, value)) for value, most in zip(torque, limit, strict=True))
    return hip, knee
