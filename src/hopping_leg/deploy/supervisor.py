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

from hopping_leg.deploy import stop_reasons
from hopping_leg.deploy.drive_link import BRAKE, LIMP, STOP, Action, DriveCommand, DriveMode, Pair
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.deploy.stop_reasons import Cause, Operator, Reason, SupervisorInput


class State(IntEnum):
    """What the supervisor lets happen."""

    DISARMED = 0
    ARMING = 1
    RUNNING = 2
    DAMPING = 3
    STOPPED = 4


_NOTHING_YET = Cause(Reason.NONE)
_NO_COUNTS = stop_reasons.Counts()


@dataclass(frozen=True, slots=True)
class SupervisorState:
    """All that the supervisor remembers from tick to tick.

    Attributes:
        state: Now.
        since: When it was entered, s.
        cause: Why the last transition happened.
        stop_cause: Why ``damping`` was entered last.
        counts: What only several ticks together tell.
        told: Torques that left last, N m.
    """

    state: State = State.DISARMED
    since: float = 0.0
    cause: Cause = _NOTHING_YET
    stop_cause: Cause = _NOTHING_YET
    counts: stop_reasons.Counts = _NO_COUNTS
    told: Pair = (0.0, 0.0)


def supervise(
    limits: SafetyLimits, before: SupervisorState, seen: SupervisorInput
) -> tuple[SupervisorState, DriveCommand]:
    """Decide a tick: what to remember, and what leaves, always finite and within the limits."""
    counts = before.counts.after(limits, seen, before.told)
    state, cause = _next(limits, before, counts, seen)
    outgoing = _outgoing(limits, state, seen)
    since, stop_cause = before.since, before.stop_cause
    if state is not before.state:
        since, stop_cause = seen.time, cause if state is State.DAMPING else stop_cause
    return SupervisorState(state, since, cause, stop_cause, counts, outgoing.torque), outgoing


def _next(
    limits: SafetyLimits,
    before: SupervisorState,
    counts: stop_reasons.Counts,
    seen: SupervisorInput,
) -> tuple[State, Cause]:
    """Return the state after a tick and the cause of the change, if it is one."""
    match before.state:
        case State.DISARMED | State.STOPPED:
            if seen.operator is Operator.ARM:
                return State.ARMING, Cause(Reason.OPERATOR_ARMED)
            if seen.operator is Operator.STOP and before.state is State.DISARMED:
                return State.STOPPED, Cause(Reason.OPERATOR_STOP)
        case State.DAMPING:
            return _calm_down(limits, before, seen)
        case State.ARMING | State.RUNNING:
            arming = before.state is State.ARMING
            if seen.operator is Operator.STOP:
                return State.DAMPING, Cause(Reason.OPERATOR_STOP)
            found = stop_reasons.find_cause(limits, before.counts, counts, seen, arming=arming)
            if found is not None:
                return State.DAMPING, found
            if arming:
                return _arm(limits, before, seen)
            if seen.finished:
                return State.DAMPING, Cause(Reason.FINISHED)
    return before.state, before.cause


def _arm(
    limits: SafetyLimits, before: SupervisorState, seen: SupervisorInput
) -> tuple[State, Cause]:
    if all(reply is not None and reply.mode == DriveMode.POSITION for reply in seen.replies):
        return State.RUNNING, Cause(Reason.DRIVES_READY)
    if not seen.time - before.since <= limits.arming_time:
        return State.DAMPING, Cause(Reason.ARMING_TOOK_TOO_LONG)
    return State.ARMING, before.cause


def _calm_down(
    limits: SafetyLimits, before: SupervisorState, seen: SupervisorInput
) -> tuple[State, Cause]:
    elapsed = seen.time - before.since
    pairs = zip(seen.replies, before.counts.last, strict=True)
    # An encoder that gives the same to the last bit may be dead, whatever the leg was stopped for.
    resting = before.stop_cause.reason is not Reason.VELOCITY_FALSE and all(
        now and abs(now.velocity) <= limits.rest_speed and last and now.position != last.position
        for now, last in pairs
    )
    if resting and elapsed >= limits.damping_least:
        return State.STOPPED, Cause(Reason.CAME_TO_REST)
    if not elapsed <= limits.damping_most:
        return State.STOPPED, Cause(Reason.DAMPED_LONG_ENOUGH)
    return State.DAMPING, before.cause


def _outgoing(limits: SafetyLimits, state: State, seen: SupervisorInput) -> DriveCommand:
    match state:
        case State.ARMING:
            return LIMP
        case State.RUNNING if seen.wanted is not None:
            pairs = zip(seen.wanted, limits.torque, strict=True)
            hip, knee = (max(-most, min(most, value)) for value, most in pairs)
            return DriveCommand(Action.TORQUE, (hip, knee))
        case State.DAMPING:
            return BRAKE
    return STOP
