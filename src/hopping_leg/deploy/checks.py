"""What can be wrong at a tick: pure functions from what was seen to a cause."""

import math
from dataclasses import dataclass

from hopping_leg.deploy.envelope import Envelope
from hopping_leg.deploy.observation import DriveMode, Observation, Replies, Reply
from hopping_leg.deploy.reasons import Reason, fault_text
from hopping_leg.deploy.wire import JOINTS


@dataclass(frozen=True, slots=True)
class Cause:
    """A reason with what was seen.

    Attributes:
        reason: Which.
        detail: Joint and number, or nothing.
    """

    reason: Reason
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.reason.sentence} ({self.detail})" if self.detail else self.reason.sentence


@dataclass(frozen=True, slots=True)
class Counts:
    """What only several ticks together can tell.

    Attributes:
        last: Latest reply of each drive.
        missing: Ticks since then.
        excess: Ticks in a row with too much torque.
        overruns: Ticks in a row that began too late.
    """

    last: Replies = (None, None)
    missing: tuple[int, int] = (0, 0)
    excess: tuple[int, int] = (0, 0)
    overruns: int = 0

    def after(self, envelope: Envelope, seen: Observation) -> "Counts":
        """Return the counts after a tick."""
        hip, knee = (
            self._of_drive(i, envelope, reply, self.last[i]) for i, reply in enumerate(seen.replies)
        )
        late = seen.late > envelope.period
        return Counts(
            (hip[0], knee[0]),
            (hip[1], knee[1]),
            (hip[2], knee[2]),
            self.overruns + 1 if late else 0,
        )

    def _of_drive(
        self, index: int, envelope: Envelope, reply: Reply | None, last: Reply | None
    ) -> tuple[Reply | None, int, int]:
        if reply is None:
            return last, self.missing[index] + 1, self.excess[index]
        much = abs(reply.torque) > envelope.excess_torque * envelope.torque[index]
        return reply, 0, self.excess[index] + 1 if much else 0


def find_cause(
    envelope: Envelope, before: Counts, now: Counts, seen: Observation, *, arming: bool
) -> Cause | None:
    """Return the gravest thing that is wrong at a tick, or None.

    Args:
        envelope: The limits.
        before: Counts before the tick.
        now: Counts after it.
        seen: At the tick.
        arming: Whether the drives are still on their way into torque control.
    """
    for index, reply in enumerate(seen.replies):
        if reply is not None:
            found = _of_drive(reply, arming=arming) or _of_joint(
                envelope, index, before.last[index], reply
            )
            if found is not None:
                return Cause(found.reason, f"{JOINTS[index]}: {found.detail}")
    for index, joint in enumerate(JOINTS):
        if now.excess[index] > envelope.excess_ticks:
            return Cause(Reason.TORQUE_LIMIT, f"{joint}: limit {envelope.torque[index]:g} N m")
        if now.missing[index] > envelope.missing_ticks:
            return Cause(Reason.REPLIES_MISSING, f"{joint}: {now.missing[index]} ticks")
    return _of_loop(envelope, now, seen)


def _of_drive(reply: Reply, *, arming: bool) -> Cause | None:
    if reply.mode == DriveMode.TORQUE:
        return None
    if reply.mode == DriveMode.FAULT:
        return Cause(Reason.DRIVE_FAULT, fault_text(reply.fault))
    if reply.mode == DriveMode.TIMEOUT:
        return Cause(Reason.DRIVE_TIMEOUT, "mode 11")
    if arming and reply.mode <= DriveMode.CALIBRATED:
        return None
    return Cause(Reason.DRIVE_LEFT_MODE, f"mode {reply.mode}")


def _of_joint(envelope: Envelope, index: int, last: Reply | None, reply: Reply) -> Cause | None:
    """The comparisons are written so that NaN fails them."""
    if not (math.isfinite(reply.position + reply.velocity + reply.torque)):
        values = f"{reply.position:g} rad, {reply.velocity:g} rad/s, {reply.torque:g} N m"
        return Cause(Reason.MEASUREMENT_NOT_FINITE, values)
    if last is not None:
        elapsed = max(reply.taken - last.taken, 0.0)
        predicted = last.position + elapsed * (last.velocity + reply.velocity) / 2
        error = abs(reply.position - predicted)
        if not error <= envelope.jump * max(1.0, elapsed / envelope.period):
            return Cause(Reason.ENCODER_JUMP, f"{error:.3g} rad off")
    if not envelope.lower[index] <= reply.position <= envelope.upper[index]:
        return Cause(
            Reason.POSITION_LIMIT,
            f"{reply.position:.3g} rad, valid"
            f" {envelope.lower[index]:.3g} to {envelope.upper[index]:.3g} rad",
        )
    if not abs(reply.velocity) <= envelope.speed[index]:
        return Cause(
            Reason.SPEED_LIMIT, f"{reply.velocity:.3g} rad/s, limit {envelope.speed[index]:.3g}"
        )
    if not reply.temperature <= envelope.temperature:
        return Cause(
            Reason.TOO_HOT, f"{reply.temperature:.0f} deg C, limit {envelope.temperature:g}"
        )
    if not reply.voltage >= envelope.voltage_low:
        return Cause(Reason.VOLTAGE_LOW, f"{reply.voltage:.1f} V, least {envelope.voltage_low:g} V")
    if not reply.voltage <= envelope.voltage_high:
        return Cause(
            Reason.VOLTAGE_HIGH, f"{reply.voltage:.1f} V, most {envelope.voltage_high:g} V"
        )
    return None


def _of_loop(envelope: Envelope, now: Counts, seen: Observation) -> Cause | None:
    if not seen.late <= envelope.stall:
        return Cause(Reason.LOOP_STALLED, f"{seen.late * 1e3:.1f} ms late")
    if now.overruns > envelope.overrun_ticks:
        return Cause(Reason.LOOP_OVERRUN, f"{now.overruns} ticks")
    if seen.wanted is None:
        return Cause(Reason.CONTROLLER_FAILED)
    if not math.isfinite(seen.wanted[0] + seen.wanted[1]):
        return Cause(
            Reason.TORQUE_NOT_FINITE, f"hip {seen.wanted[0]:g}, knee {seen.wanted[1]:g} N m"
        )
    return None
