"""What the joints may do: the motors' torque-speed limit and the paper's soft position limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

HOPPING_MARGINS = (0.9, 0.5)
"""How far hip and knee of a hopping leg may pass their soft limits, rad. The soft limits' PD acts
before; it gives way where a policy swings the leg, most of all at the hip, whose mechanical stops
are far."""


def hopping_ranges(robot: Robot) -> list[tuple[float, float]]:
    """Return within which angles hip and knee of a hopping leg stay, rad.

    Beyond them the supervisor of the real leg stops it.
    """
    joints = zip((robot.hip, robot.knee), HOPPING_MARGINS, strict=True)
    return [
        (max(j.lower - margin, j.stop_lower), min(j.upper + margin, j.stop_upper))
        for j, margin in joints
    ]


def command_limits(robot: Robot) -> tuple[float, float]:
    """Return the heights a leg can be asked for, m: folded standing to twice its length."""
    folded = np.array([robot.hip.upper, robot.knee.lower])
    return float(kinematics.stance_height(robot, folded)), 2 * robot.straight_height


class MotorLimit:
    """Torque each joint's motor can give at a speed.

    The driving torque falls on the line from the peak torque at rest to zero at the no-load speed;
    the software limit caps it; braking is limited by the software limit alone. A robot per leg is
    given where legs differ. With a ``count`` of legs n, all inputs are (n, 2), which is faster.
    """

    def __init__(self, robot: Robot | Sequence[Robot], count: int | None = None) -> None:
        robots = [robot] if isinstance(robot, Robot) else robot
        lines = np.stack([_torque_speed_line(one) for one in robots], axis=1)
        limit, peak, slope = lines[:, 0] if isinstance(robot, Robot) else lines
        self.limit, self.peak, self._slope = (_per_leg(x, count) for x in (limit, peak, slope))
        self._minus_limit, self._minus_peak = -self.limit, -self.peak
        self._zero = np.zeros_like(self.limit)
        gains = np.stack([one.of_joints("torque_gain") for one in robots])
        gain = gains[0] if isinstance(robot, Robot) else gains
        self._gain = _per_leg(gain, count) if (gains != 1).any() else None

    def give(self, torque: Array, qd: Array) -> Array:
        """Return what the motors give, N m, (..., 2), if asked for so much at a speed, rad/s."""
        within = self.clip(torque, qd)
        return within if self._gain is None else self._gain * within

    def clip(self, torque: Array, qd: Array) -> Array:
        """Return ``torque`` within what the motors can do at speed ``qd``, see ``give``."""
        drop = self._slope * qd
        upper = self.peak - drop
        np.maximum(upper, self._zero, out=upper)
        np.minimum(upper, self.limit, out=upper)
        lower = np.subtract(self._minus_peak, drop, out=drop)
        np.minimum(lower, self._zero, out=lower)
        np.maximum(lower, self._minus_limit, out=lower)
        return np.minimum(np.maximum(torque, lower), upper)


def _torque_speed_line(robot: Robot) -> Array:
    """Return software limit, peak torque and slope of both joints, (3, 2)."""
    joints = (robot.hip, robot.knee)
    peak = np.array([j.motor.peak_torque for j in joints]) * robot.of_joints("belt_ratio")
    slope = peak / robot.of_joints("no_load_speed")
    return np.stack([robot.of_joints("torque_limit"), peak, slope])


@dataclass(frozen=True)
class SoftLimits:
    """PD that pulls the joints back into bounds once they are passed (paper, Sec. II-C).

    Raises:
        UsageError: A value is negative.
    """

    stiffness: float = 20.0
    """Stiffness of the PD, N m/rad."""
    damping: float = 0.15
    """Damping of the PD, N m s/rad; above 2 I/dt of the shank a 200 Hz loop would ring."""
    inset: float = 0.0
    """How far inside the limit the PD aims, rad."""
    replace: bool = False
    """Replace the controller's torque while outside, as printed, instead of adding to it."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "inset"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                valid = "must be zero or more and finite"
                raise UsageError(f"'{name}' of the soft limits is {value} but {valid}.")


class SoftLimiter:
    """Applies soft limits to a robot's joint torques.

    With a ``count`` of legs n, all inputs are (n, 2), which is faster; any shape if None.
    """

    def __init__(self, robot: Robot, soft: SoftLimits, count: int | None = None) -> None:
        self.soft = soft
        self._lower = _per_leg(robot.of_joints("lower"), count)
        self._upper = _per_leg(robot.of_joints("upper"), count)

    def apply(self, torque: Array, q: Array, qd: Array) -> Array:
        """Return the torque, N m, (..., 2), with the PD added or put where a joint is outside."""
        back = np.minimum(np.maximum(q, self._lower), self._upper) - q
        if not np.count_nonzero(back):
            return torque
        soft = self.soft
        outside = back != 0
        if soft.inset:
            back += np.copysign(soft.inset, back)
        pull = soft.stiffness * back - soft.damping * qd
        if soft.replace:
            return np.where(outside, pull, torque)
        pull *= outside
        return torque + pull


def _per_leg(of_joints: Array, count: int | None) -> Array:
    """Repeat (2,) for every leg: numpy adds equal shapes in half the time of broadcast ones."""
    return of_joints if count is None else np.broadcast_to(of_joints, (count, 2)).copy()
