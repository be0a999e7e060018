"""Why the supervisor changes its state: the reasons, and the checks that find one at a tick."""

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum

from hopping_leg.deploy.drive_link import DriveMode, FaultCode, Pair, Replies, Reply
from hopping_leg.deploy.plausibility import JointEvidence, LagEvidence
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.robot.parameters import JOINTS


class Reason(IntEnum):
    """A code for the trace and a sentence for people."""

    sentence: str

    def __new__(cls, code: int, sentence: str) -> "Reason":
        """Attach the sentence to the code."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member

    NONE = 0, "Nothing has happened yet."
    OPERATOR_ARMED = 1, "The operator armed the drives."
    DRIVES_READY = 2, "Both drives follow torques."
    FINISHED = 3, "The sequence is over."
    CAME_TO_REST = 4, "The joints are at rest."
    DAMPED_LONG_ENOUGH = 5, "The joints may still move: look before you touch."
    OPERATOR_STOP = 10, "The operator asked for a stop."
    ARMING_TOOK_TOO_LONG = 11, "A drive did not begin to follow torques in time."
    DRIVE_FAULT = 12, "A drive reports a fault."
    DRIVE_TIMEOUT = 13, "A drive's own watchdog tripped: it had no command in time."
    DRIVE_LEFT_MODE = 14, "A drive left torque control by itself, e.g. because it restarted."
    REPLIES_MISSING = 15, "A drive did not answer in several ticks."
    MEASUREMENT_NOT_FINITE = 16, "A drive reports a position, velocity or torque that is no number."
    ENCODER_JUMP = 17, "A position changed by more than its velocity allows."
    POSITION_LIMIT = 18, "A joint left its range."
    SPEED_LIMIT = 19, "A joint is faster than its motor can turn it."
    TORQUE_LIMIT = 20, "A motor gives more torque than it may."
    TOO_HOT = 21, "A drive is too hot."
    VOLTAGE_LOW = 22, "The bus voltage is too low."
    VOLTAGE_HIGH = 23, "The bus voltage is too high."
    LOOP_OVERRUN = 24, "This computer was late: the control loop missed too many ticks."
    LOOP_STALLED = 25, "This computer was late: the control loop stood still too long."
    CONTROLLER_FAILED = 26, "The controller raised an error."
    TORQUE_NOT_FINITE = 27, "The controller asked for a torque that is no number."
    ENCODER_DRIFT = 30, "A position moves away from what its velocity adds up to."
    STANDS_WRONG = 29, "The leg does not stand as its robot's file says."
    ENCODER_DEAD = 31, "A drive repeats a position that cannot be true: its encoder may be dead."
    VELOCITY_FALSE = 32, "A drive's velocity is not that of its position."
    TORQUE_FALSE = 33, "A drive reports another torque than it was told."
    SAMPLES_STALE = 34, "The drives' samples are older than before."
    DRIVE_CLOCK = 35, "A drive's clock does not run as this computer's does."
    CONTROLLER_SLOW = 28, "The controller took too much of a control period."


_DRIFT_SECONDS = 1.0  # Time after which a drift is forgotten
_DRIFT_SPEED = 2.0  # rad/s; what is faster counts as that while a joint is shaken
_GAP = 1.5  # Periods between two replies beyond which velocities no longer tell the way between
_IMPACT = 3.0  # Change of speed between two replies beyond which they do not, rad/s

_ON_TIME = 0.2
"""Of a late tick that one in time makes up for: one late tick in six is tolerated for ever."""


def _late_text(seconds: float) -> str:
    return f"{seconds * 1e3:.1f} ms late; end other programs, or permit real-time priority"


def fault_text(code: int) -> str:
    """Return a fault code with its meaning."""
    known = code in set(FaultCode)
    meaning = FaultCode(code).name.lower().replace("_", " ") if known else "unknown"
    return f"fault {code} ({meaning})"


@dataclass(frozen=True, slots=True)
class Cause:
    """A reason with what was seen."""

    reason: Reason
    detail: str = ""
    """Joint and number, or nothing."""

    def __str__(self) -> str:
        return f"{self.reason.sentence} ({self.detail})" if self.detail else self.reason.sentence


class Operator(Enum):
    """What the operator asked for since the last tick."""

    NOTHING = 0
    ARM = 1
    STOP = 2


@dataclass(frozen=True, slots=True)
class SupervisorInput:
    """Everything that a decision of the supervisor depends on.

    Attributes:
        time: Tick's deadline, s.
        late: How long after its deadline the tick began, s.
        replies: Fresh in this tick.
        wanted: Joint torques that the sequence asks for, N m; None if the controller failed.
        operator: Since the last tick.
        finished: Whether the sequence is over.
        controller: How long the controller took in the tick before, s.
        trouble: Why the sequence must not go on; empty if it may.
    """

    time: float
    late: float
    replies: Replies
    wanted: Pair | None
    operator: Operator = Operator.NOTHING
    finished: bool = False
    controller: float = 0.0
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class Counts:
    """What only several ticks together can tell.

    Attributes:
        last: Latest reply of each drive.
        missing: Ticks since then.
        excess: Ticks in a row with too much torque.
        overruns: Ticks that began too late, less a part of one for each in time since then.
        late: How late the last of them began, s.
        drift: What positions gained over their velocities lately, rad.
        evidence: What each drive's replies told lately.
        lag: How late the torques of both came lately.
    """

    last: Replies = (None, None)
    missing: tuple[int, int] = (0, 0)
    excess: tuple[int, int] = (0, 0)
    overruns: float = 0.0
    late: float = 0.0
    drift: Pair = (0.0, 0.0)
    evidence: tuple[JointEvidence, JointEvidence] = (JointEvidence(), JointEvidence())
    lag: LagEvidence = field(default_factory=LagEvidence)

    def after(self, limits: SafetyLimits, seen: SupervisorInput, told: Pair) -> "Counts":
        """Return the counts after a tick; ``told`` are the torques that left in the last, N m."""
        hip, knee = (self._of_drive(i, limits, reply) for i, reply in enumerate(seen.replies))
        overruns, late = max(self.overruns - _ON_TIME, 0.0), self.late
        if seen.late > limits.period:
            overruns, late = self.overruns + 1, seen.late
        drift = self._drifted(0, limits, hip[0]), self._drifted(1, limits, knee[0])
        evidence = self._known(0, limits, seen, told), self._known(1, limits, seen, told)
        lag = self.lag.after(limits.motors, seen.replies, told)
        return Counts(
            (hip[0], knee[0]), (hip[1], knee[1]), (hip[2], knee[2]),
            overruns, late, drift, evidence, lag,
        )  # fmt: skip

    def _known(
        self, index: int, limits: SafetyLimits, seen: SupervisorInput, told: Pair
    ) -> JointEvidence:
        known, reply = self.evidence[index], seen.replies[index]
        if reply is None:
            return known
        return known.after(limits.motors[index], self.last[index], reply, told[index])

    def _drifted(self, index: int, limits: SafetyLimits, reply: Reply | None) -> float:
        """Return a drive's drift with a reply; across a gap or an impact it is unknown."""
        last, drift = self.last[index], self.drift[index]
        if reply is None or last is None or abs(reply.velocity - last.velocity) > _IMPACT:
            return drift
        elapsed = reply.taken - last.taken
        if not 0 < elapsed < _GAP * limits.period:
            return drift
        most = _DRIFT_SPEED * elapsed if self.evidence[index].shaken > _IMPACT else math.inf
        gained = max(-most, min(most, _unexplained(last, reply)))
        return drift * math.exp(-elapsed / _DRIFT_SECONDS) + gained

    def _of_drive(
        self, index: int, limits: SafetyLimits, reply: Reply | None
    ) -> tuple[Reply | None, int, int]:
        if reply is None:
            return self.last[index], self.missing[index] + 1, self.excess[index]
        much = abs(reply.torque) > limits.excess_torque * limits.torque[index]
        return reply, 0, self.excess[index] + 1 if much else 0


def _unexplained(last: Reply, reply: Reply) -> float:
    """Return the part of a position's change that the velocities do not tell, rad."""
    elapsed = max(reply.taken - last.taken, 0.0)
    return reply.position - last.position - elapsed * (last.velocity + reply.velocity) / 2


def find_cause(
    limits: SafetyLimits, before: Counts, now: Counts, seen: SupervisorInput, *, arming: bool
) -> Cause | None:
    """Return the gravest thing that is wrong at a tick, or None.

    The counts are those before and after the tick; ``arming`` tells whether the drives are still
    on their way into torque control.
    """
    fresh = [(index, reply) for index, reply in enumerate(seen.replies) if reply is not None]
    for index, reply in sorted(fresh, key=lambda pair: pair[1].mode != DriveMode.FAULT):
        found = _of_drive(reply, now, arming=arming) or _of_joint(
            limits, index, before.last[index], reply
        )
        if found is not None:
            return Cause(found.reason, f"{JOINTS[index]}: {found.detail}")
    for index, joint in enumerate(JOINTS):
        if not abs(now.drift[index]) <= limits.drift:
            return Cause(Reason.ENCODER_DRIFT, f"{joint}: {abs(now.drift[index]):.3g} rad off")
        evidence = now.evidence[index]
        for reason, complaint in (
            (Reason.ENCODER_DEAD, evidence.dead(limits.motors[index])),
            (Reason.VELOCITY_FALSE, evidence.false_velocity()),
            (Reason.TORQUE_FALSE, "" if arming else evidence.false_torque()),
        ):
            if complaint:
                return Cause(reason, f"{joint}: {complaint}")
        told = seen.replies[index]
        if told is not None and not told.ahead <= limits.clock:
            return Cause(Reason.DRIVE_CLOCK, f"{joint}: {told.ahead * 1e3:.1f} ms gained")
        if now.excess[index] > limits.excess_ticks:
            return Cause(Reason.TORQUE_LIMIT, f"{joint}: limit {limits.torque[index]:g} N m")
        if now.missing[index] > limits.missing_ticks:
            late = f"; this computer was {_late_text(now.late)}" if now.overruns else ""
            return Cause(Reason.REPLIES_MISSING, f"{joint}: {now.missing[index]} ticks{late}")
    if not arming and (stale := now.lag.stale()):
        return Cause(Reason.SAMPLES_STALE, stale)
    return _of_loop(limits, now, seen)


def _of_drive(reply: Reply, now: Counts, *, arming: bool) -> Cause | None:
    if reply.mode == DriveMode.FAULT:
        return Cause(Reason.DRIVE_FAULT, fault_text(reply.fault))
    if reply.mode == DriveMode.POSITION or (arming and reply.mode <= DriveMode.CALIBRATED):
        return None
    if reply.mode == DriveMode.TIMEOUT and now.overruns:
        return Cause(Reason.LOOP_STALLED, f"the drive's watchdog tripped, {_late_text(now.late)}")
    if reply.mode == DriveMode.TIMEOUT:
        return Cause(Reason.DRIVE_TIMEOUT, "mode 11")
    return Cause(Reason.DRIVE_LEFT_MODE, f"mode {reply.mode}")


def _of_joint(limits: SafetyLimits, index: int, last: Reply | None, reply: Reply) -> Cause | None:
    """The comparisons are written so that NaN fails them."""
    if not (math.isfinite(reply.position + reply.velocity + reply.torque)):
        values = f"{reply.position:g} rad, {reply.velocity:g} rad/s, {reply.torque:g} N m"
        return Cause(Reason.MEASUREMENT_NOT_FINITE, values)
    if last is not None:
        periods = (reply.taken - last.taken) / limits.period
        error = abs(_unexplained(last, reply))
        if not error <= limits.jump * max(1.0, periods):
            return Cause(Reason.ENCODER_JUMP, f"{error:.3g} rad off")
    ahead = reply.position + limits.braking[index] * reply.velocity
    lower, upper = limits.lower[index], limits.upper[index]
    if not (lower <= min(reply.position, ahead) and max(reply.position, ahead) <= upper):
        return Cause(
            Reason.POSITION_LIMIT,
            f"{reply.position:.3g} rad at {reply.velocity:.3g} rad/s would end at {ahead:.3g} rad,"
            f" valid {lower:.3g} to {upper:.3g} rad",
        )
    if not abs(reply.velocity) <= limits.speed[index]:
        return Cause(
            Reason.SPEED_LIMIT, f"{reply.velocity:.3g} rad/s, limit {limits.speed[index]:.3g}"
        )
    if not reply.temperature <= limits.temperature:
        return Cause(Reason.TOO_HOT, f"{reply.temperature:.0f} deg C, limit {limits.temperature:g}")
    if not reply.voltage >= limits.voltage_low:
        return Cause(Reason.VOLTAGE_LOW, f"{reply.voltage:.1f} V, least {limits.voltage_low:g} V")
    if not reply.voltage <= limits.voltage_high:
        return Cause(Reason.VOLTAGE_HIGH, f"{reply.voltage:.1f} V, most {limits.voltage_high:g} V")
    return None


def _of_loop(limits: SafetyLimits, now: Counts, seen: SupervisorInput) -> Cause | None:
    stalled = not seen.late <= limits.stall
    if stalled or now.overruns > limits.overrun_ticks:
        if seen.controller > limits.period / 2:
            took, period = seen.controller * 1e3, limits.period * 1e3
            return Cause(Reason.CONTROLLER_SLOW, f"{took:.1f} ms of {period:g} ms")
        reason = Reason.LOOP_STALLED if stalled else Reason.LOOP_OVERRUN
        return Cause(reason, _late_text(seen.late))
    if seen.trouble:
        return Cause(Reason.STANDS_WRONG, seen.trouble)
    if seen.wanted is None:
        return Cause(Reason.CONTROLLER_FAILED)
    if not math.isfinite(seen.wanted[0] + seen.wanted[1]):
        return Cause(
            Reason.TORQUE_NOT_FINITE, f"hip {seen.wanted[0]:g}, knee {seen.wanted[1]:g} N m"
        )
    return None
