"""Whether what the drives say can be true: position, velocity, torque and command together.

Each comparison holds for healthy legs of any mass, friction, play and ground; their thresholds
leave room for impacts, play and noise, and were set on simulated runs:

- A joint that moved does not come to rest to the last bit within a tick. It does not stay so while
  the torque on it changes by more than its friction. And a sensor with noise never stays so. A dead
  encoder, which repeats a position with a velocity of zero, does all three.
- From reply to reply the way of a position is the integral of its velocity, but for impacts and
  for a joint that rattles faster than replies tell.
- What a motor gives is what it was told, within what it can give at its speed, and always about as
  late: where the torques of both joints come later than before, samples are old. Torques that
  alternate from tick to tick tell neither, nor does a joint that is shaken.
"""

import math
from dataclasses import dataclass, replace

from hopping_leg.deploy.drive_link import DriveMode, Pair, Replies, Reply

_STILL_RADIANS, _STILL_SPEED = 1e-6, 1e-3
"""Change of a position between two replies, and speed, rad/s, up to which a joint is at rest to the
last bit; so is one whose velocity repeats as well. A leg that comes to rest gets there slowly: its
speed is below 3e-3 rad/s before."""
_MOVED = 0.02  # rad/s, beyond which a joint did move before
_DEAD = 4  # replies in a row at rest
_STILL_TORQUE = (0.2, 4.0)  # N m, and times the file's friction: change of torque that moves it
_NOISY, _CHANCE, _SILENT = 8, 1, 6
"""A sensor is known to have noise after so many replies of which no more in a row repeated another
than by chance; so many replies in a row at rest are then too many."""

_FADING = 0.03  # s, within which comparisons of one joint forget
_IMPACT = 2.0  # Change of speed between two replies beyond which velocities do not tell the way
_WAY = 4e-3  # rad between two replies from which on position and velocity are compared
_OTHER_WAY = (1e-3, 0.33)  # rad, and share of the longer way, by which they may differ
_CONTRADICTIONS = 7  # in a row; impacts and play make four
_RATTLE = 0.5  # rad/s by which the velocity of a joint that rattles goes up and down in turn
_SHAKEN = 10.0  # rad/s between two replies: so fast a motor's torque is not that of one speed
_PUSH = 1e-2  # of squared torques over the limit squared that must be known
_GIVEN = 0.1  # least torque reported over torque told

_TICKS = 4  # by which a reported torque may come after the command
_LAGS = 2 * _TICKS - 1  # 1, 1.5, 2, ... ticks
_LATEST = 3  # of these, the last that is a healthy drive's
_LAG_FADING = 10  # ticks, which must be known before a lag is
_LAG_CHANGE = 0.01  # of squared changes of torque over the limit squared that must be known
_LAG_CLEAR = 3.0  # factor by which one lag must explain the torques better than one a tick away
_LAG_WORSE = 8.0  # factor by which the usual lag, and half a tick more, must explain them worse
_LAG_TICKS = 4  # for so many ticks in a row


@dataclass(frozen=True, slots=True)
class MotorLine:
    """What a motor can give, at the joint.

    Attributes:
        limit: Largest torque that leaves for it, N m.
        stall: Torque at rest, N m.
        no_load_speed: Speed at which it has none left, rad/s.
        friction: Of the joint, N m.
    """

    limit: float
    stall: float
    no_load_speed: float
    friction: float

    def share(self, torque: float, velocity: float) -> float:
        """Return what the motor gives of a torque, N m, at a speed, rad/s, over its limit."""
        drop = self.stall * velocity / self.no_load_speed
        high = min(max(self.stall - drop, 0.0), self.limit)
        low = max(min(-self.stall - drop, 0.0), -self.limit)
        return max(low, min(high, torque)) / self.limit


@dataclass(frozen=True, slots=True)
class JointEvidence:
    """What the replies of one drive told lately.

    Attributes:
        replies: How many there were.
        still: Of them in a row at rest to the last bit, until now, while the drive was powered.
        stillest: Most in a row that were so before; of a drive without power, all together.
        speed_before: Speed before them, rad/s.
        torques: Lowest and highest torque that was told meanwhile, N m.
        contradictions: Times in a row that a moving joint's position and velocity differed.
        newer, older: Sums of the squared torque that was told one tick, two ticks before, and of
            its product with the reported torque, over the limit squared, fading.
        told: Torques that were told one and two ticks before, N m.
        given: Torque of the reply, over the limit.
        swing: Change of velocity with the reply, rad/s.
        shaken: Largest change of velocity lately, rad/s, halved from reply to reply.
    """

    replies: int = 0
    still: int = 0
    stillest: int = 0
    speed_before: float = 0.0
    torques: Pair = (0.0, 0.0)
    contradictions: int = 0
    newer: Pair = (0.0, 0.0)
    older: Pair = (0.0, 0.0)
    told: Pair = (0.0, 0.0)
    given: float = 0.0
    swing: float = 0.0
    shaken: float = 0.0

    def after(
        self, motor: MotorLine, last: Reply | None, reply: Reply, told: float
    ) -> "JointEvidence":
        """Return the evidence with a reply; ``told`` is the torque in force since the last, N m."""
        if last is None:
            return JointEvidence(told=(told, told))
        elapsed, way = reply.taken - last.taken, reply.position - last.position
        same_speed = abs(reply.velocity) <= _STILL_SPEED or reply.velocity == last.velocity
        repeats = abs(way) <= _STILL_RADIANS and same_speed
        if reply.mode != DriveMode.POSITION:  # a leg may be held, or stand
            return JointEvidence(
                self.replies + 1, stillest=self.stillest + repeats, told=(told, told)
            )
        still, stillest, before, torques = 0, max(self.stillest, self.still), 0.0, (told, told)
        if repeats:
            still, stillest, before = self.still + 1, self.stillest, abs(last.velocity)
            if self.still:
                before = self.speed_before
                torques = min(self.torques[0], told), max(self.torques[1], told)
        contradictions, newer, older = self.contradictions, (0.0, 0.0), (0.0, 0.0)
        given, swing = reply.torque / motor.limit, reply.velocity - last.velocity
        if 0 < elapsed < _FADING:
            if abs(swing) <= _IMPACT:
                integral = elapsed * (last.velocity + reply.velocity) / 2
                longer, (least, share) = max(abs(way), abs(integral)), _OTHER_WAY
                if longer > _WAY:
                    differs = abs(way - integral) > least + share * longer
                    contradictions = contradictions + 1 if differs else 0
            rattles = swing * self.swing < 0 and min(abs(swing), abs(self.swing)) > _RATTLE
            if rattles or reply.velocity * last.velocity <= 0:
                contradictions = 0
            weight = 0.0 if rattles or max(abs(swing), self.shaken) > _SHAKEN else 1.0
            fading, mean = math.exp(-elapsed / _FADING), (given + self.given) / 2
            first, second, third = (
                motor.share(torque, reply.velocity) for torque in (told, *self.told)
            )
            newer = _summed(self.newer, fading, weight * (first + second) / 2, mean)
            older = _summed(self.older, fading, weight * (second + third) / 2, mean)
        return JointEvidence(
            self.replies + 1, still, stillest, before, torques, contradictions, newer, older,
            (told, self.told[0]), given, swing, max(abs(swing), self.shaken / 2),
        )  # fmt: skip

    def dead(self, motor: MotorLine) -> str:
        """Return why the encoder must be dead, "" if it need not."""
        if self.still < _DEAD:
            return ""
        if self.speed_before > _MOVED:
            return f"at rest to the last bit after {self.speed_before:.2g} rad/s"
        noisy = self.stillest <= _CHANCE and self.replies - self.still > _NOISY
        if noisy and self.still >= _SILENT:
            return f"{self.still} times the same where no readings repeated others before"
        least, times = _STILL_TORQUE
        change = self.torques[1] - self.torques[0]
        if change > least + times * motor.friction:
            return f"at rest to the last bit while its torque changed by {change:.2g} N m"
        return ""

    def false_velocity(self) -> str:
        """Return how velocity and position contradict each other, "" if they do not."""
        if self.contradictions < _CONTRADICTIONS:
            return ""
        return f"{self.contradictions} times in a row it moved otherwise than its velocity says"

    def false_torque(self) -> str:
        """Return how reported and told torque contradict each other, "" if they do not."""
        if min(self.newer[0], self.older[0]) < _PUSH:
            return ""
        newer, older = (product / square for square, product in (self.newer, self.older))
        return "" if max(newer, older) >= _GIVEN else f"it reports {newer:.0%} of what it was told"


def _summed(sums: Pair, fading: float, told: float, given: float) -> Pair:
    return fading * sums[0] + told * told, fading * sums[1] + told * given


@dataclass(frozen=True, slots=True)
class LagEvidence:
    """How late the drives' torques come after the commands, both joints together.

    Changes from tick to tick are compared, whatever the motors' gain.

    Attributes:
        told: Torques that were told in the last ticks, the newest first, N m.
        given: Torques of the last replies, over the limits.
        errors: Sums of the squared difference of changes reported from those told 1, 1.5, 2 ... 4
            ticks before, over the limits squared, fading.
        changes: Sum of squared changes of the torques told, likewise.
        usual: Least of these lags, 0 the first, that ever explained the torques clearly best.
        late: Ticks in a row that another, a tick or more after it, explained them far better.
        gap: Ticks since both drives answered.
    """

    told: tuple[Pair, ...] = ()
    given: Pair = (0.0, 0.0)
    errors: tuple[float, ...] = (0.0,) * _LAGS
    changes: float = 0.0
    usual: int = _LAGS
    late: int = 0
    gap: int = 1

    def after(
        self, motors: tuple[MotorLine, MotorLine], replies: Replies, told: Pair
    ) -> "LagEvidence":
        """Return the evidence a tick later, which a lost reply leaves as it was."""
        past = (told, *self.told)[: _LAG_FADING + 1]
        fresh = [reply for reply in replies if reply is not None]
        if len(fresh) < len(replies):
            return replace(self, told=past, gap=self.gap + 1)
        hip, knee = (r.torque / m.limit for r, m in zip(fresh, motors, strict=True))
        if len(past) < _TICKS + self.gap:
            return LagEvidence(past, (hip, knee), usual=self.usual)
        fading = math.exp(-1 / _LAG_FADING)
        errors, changes = [fading * error for error in self.errors], fading * self.changes
        for joint, given in enumerate((hip - self.given[0], knee - self.given[1])):
            velocity = fresh[joint].velocity
            shares = [motors[joint].share(pair[joint], velocity) for pair in past]
            steps = [a - b for a, b in zip(shares, shares[self.gap :], strict=False)]
            for lag in range(_LAGS):
                off = given - (steps[lag // 2] + steps[(lag + 1) // 2]) / 2
                errors[lag] += off * off  # an overflow is infinite
            changes += steps[0] * steps[0]
        best = errors.index(min(errors))
        away = min(errors[: max(best - 1, 0)] + errors[best + 2 :])
        clear = changes > _LAG_CHANGE and away > _LAG_CLEAR * errors[best] + 1e-6
        usual = min(self.usual, best) if clear and len(past) > _LAG_FADING else self.usual
        least = min(errors[usual : usual + 2], default=0.0)
        worse = changes > _LAG_CHANGE and least > _LAG_WORSE * errors[best] + _LAG_CHANGE / 4
        late = self.late + 1 if worse and best > usual + 1 else 0
        return LagEvidence(past, (hip, knee), tuple(errors), changes, usual, late)

    def stale(self) -> str:
        """Return by how much the samples are older than before, "" if they are not."""
        if _LATEST < self.usual < _LAGS and self.changes > _LAG_CHANGE:
            return f"torques come {1 + self.usual / 2:g} ticks after their commands"
        later = (self.errors.index(min(self.errors)) - self.usual) / 2
        return f"torques come {later:g} ticks later" if self.late >= _LAG_TICKS else ""
