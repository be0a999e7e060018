"""Stand, let a hopping controller hop so many times, catch the leg in the air, land, stand again.

A thin layer around any controller, since none was made to stand; it measures the joints alone.
"""

from enum import IntEnum

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers import joint_pd, protocol, sample_history
from hopping_leg.controllers.energy_shaping import virtual_leg
from hopping_leg.controllers.energy_shaping.gains import load_gains, scale_gains
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.robot import GRAVITY, Robot, kinematics, load_robot
from hopping_leg.sim import CONTROL_RATE

_LANDING_LENGTH = 0.85
"""Share of the straight leg at which the foot waits for the ground; a longer one has more way to
brake."""

_LANDING_STIFFNESS, _LANDING_DAMPING = 3.0, 1.5
"""Spring and damper of the landing, in units of the leg's weight, length and (length / g)^(1/2)."""


class Landing:
    """Lands n legs on a standing length, m, with flight PD and detector of energy shaping."""

    def __init__(self, robot: Robot, count: int, standing: float) -> None:
        shipped = load_gains()
        self.robot = robot
        self._shared = scale_gains(shipped.gains, load_robot(shipped.robot), robot)
        reach = robot.thigh.length + robot.shank.length
        self._weight, self._standing = robot.mass * GRAVITY, standing
        self._stiffness = _LANDING_STIFFNESS * self._weight / reach
        self._damping = _LANDING_DAMPING * self._weight / np.sqrt(reach * GRAVITY)
        self._waiting = landing_posture(robot)
        self._detector = virtual_leg.TouchdownDetector(robot, count, debounced=True)
        self._from = np.tile(self._waiting, (count, 1))

    def begin(self, who: BoolArray, q: Array) -> None:
        """Let some legs begin to move to the landing posture from where they are, rad, (n, 2)."""
        self._from = np.where(who[:, None], q, self._from)

    def wait(self, leg: virtual_leg.LegView, clock: Array) -> tuple[Array, BoolArray]:
        """Return flight torques, N m, (n, 2), and who met the ground; clock of flight in s."""
        gains = self._shared
        target, rate = virtual_leg.retraction(self._from, self._waiting, clock, gains.retract_time)
        torque = virtual_leg.flight_torque(gains, leg, target, rate)
        met = self._detector.update(leg, rate, torque, gains)
        return torque, (met & (clock >= gains.flight_min)) | (clock > virtual_leg.FLIGHT_LIMIT)

    def brake(self, leg: virtual_leg.LegView) -> Array:
        """Return the torques of spring and damper, N m, (n, 2); they never pull the ground."""
        spring = self._stiffness * (self._standing - leg.length)
        push = np.maximum(self._weight + spring - self._damping * leg.rate, 0.0)
        side = -self._shared.kp_y * leg.y - self._shared.kd_y * leg.y_rate
        return virtual_leg.foot_force_torque(self.robot, leg.q, push, side)

    @property
    def blind(self) -> float:
        """Time after lift-off in which no touchdown is believed, s."""
        return float(self._shared.flight_min)


def landing_posture(robot: Robot) -> Array:
    """Return the posture in which a leg waits for the ground, foot below the hip, rad, (2,)."""
    length = _LANDING_LENGTH * (robot.thigh.length + robot.shank.length)
    return kinematics.joint_angles(robot, np.array([length, 0.0]))


_SMOOTHING = 0.25  # share of the newest force in the pressing force
_LEAST_PRESS = 1 / 3  # pressing force that begins a push, weights

_BEGIN, _END, _LEAST = 0.2, 0.06, 0.3
"""Leg rate that begins a push, ends it, and must have been reached, sqrt(gravity x height)."""

_SUDDEN = 0.15
"""Time between the fastest leg rate and the end of a push, s; who only rises slows down for longer.
"""

_BLIND = 0.9  # share of the ballistic flight in which no push is believed


class LiftoffDetector:
    """Detects when n legs leave the ground; ``period`` is that of control, s."""

    def __init__(self, robot: Robot, period: float, count: int) -> None:
        self._period, self._weight = period, robot.mass * GRAVITY
        self._speed = float(np.sqrt(GRAVITY * robot.straight_height))
        self._press, self._fastest = np.zeros(count), np.zeros(count)
        self._pushing = np.zeros(count, np.bool_)
        self._blind, self._slowing = np.zeros(count), np.zeros(count)

    def update(self, leg: virtual_leg.LegView, force: Array) -> BoolArray:
        """Return which legs, pressing with a force along them, N, just left the ground, (n,)."""
        bounded = np.clip(force, -4 * self._weight, 8 * self._weight)
        self._press += _SMOOTHING * (bounded - self._press)
        self._blind = np.maximum(self._blind - self._period, 0.0)
        begins = (self._press > _LEAST_PRESS * self._weight) & (leg.rate > _BEGIN * self._speed)
        begins &= ~self._pushing & (self._blind == 0)
        self._fastest = np.where(begins, 0.0, self._fastest)
        self._pushing |= begins
        faster = leg.rate > self._fastest
        self._slowing = np.where(faster, 0.0, self._slowing + self._period)
        self._fastest = np.where(faster, leg.rate, self._fastest)
        over = self._pushing & ((leg.rate < _END * self._speed) | (self._press < 0))
        self._pushing &= ~over
        left: BoolArray = over & (self._fastest > _LEAST * self._speed)
        left &= self._slowing < _SUDDEN
        self._blind = np.where(left, _BLIND * 2 * self._fastest / GRAVITY, self._blind)
        return left


STAND_SECONDS = 1.0  # before it hops

_BRAKE_SECONDS = 0.4  # after a touchdown spring and damper hold the leg so long
_RISE_SECONDS = 0.5  # of the way back to the standing posture


class Mode(IntEnum):
    """What a supervised leg does; recorded in traces."""

    STAND = 0
    """Joint PD, to and in the standing posture."""
    HOP = 1
    """The hopping controller has the leg."""
    FLY = 2
    """Caught in the air, on the way to the landing posture."""
    BRAKE = 3
    """On the ground, giving way."""


class StandHopLand:
    """Implements ``Controller`` around another one.

    Args:
        controller: Hops; None only lands.
        robot: The leg.
        hops: To make, before the leg is caught.
        rate: Control rate, Hz.
        dropped: The legs begin in the air, in ``landing_posture``, and do not hop.

    Raises:
        UsageError: The number of hops has no meaning.
    """

    def __init__(
        self,
        controller: protocol.Controller | None,
        robot: Robot,
        hops: int,
        *,
        rate: float = CONTROL_RATE,
        dropped: bool = False,
    ) -> None:
        if hops < 0 or (hops > 0) == (controller is None):
            raise UsageError(f"{hops} hops make no sense here; give 1 or more, with a controller.")
        self.name = "landing" if controller is None else controller.name
        self.robot, self.hops, self._controller, self._period = robot, hops, controller, 1 / rate
        self._dropped = dropped
        setup = RolloutConfig(robot)
        self._standing, self._posture = setup.standing_length, setup.start_posture
        self._stiffness, self._damping = (np.array(g) for g in vars(joint_pd.JointGains()).values())
        self._observer = sample_history.DatedObserver(
            self._period, load_gains().gains.position_pull
        )

    def reset(self, count: int) -> None:
        """Forget everything; the legs stand, or fall."""
        self._observer.reset(count)
        self._liftoff = LiftoffDetector(self.robot, self._period, count)
        self._landing = Landing(self.robot, count, self._standing)
        self._modes = virtual_leg.Phases(count)
        if self._dropped:
            self._modes.enter(np.ones(count, np.bool_), Mode.FLY, self._landing.blind)
        self._made = np.zeros(count, np.int64)
        self._from = np.tile(self._posture, (count, 1))
        self._torque = np.zeros((count, 2))
        if self._controller is not None:
            self._controller.reset(count)

    def act(self, measurement: protocol.Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        leg = virtual_leg.view_leg(self.robot, *self._observer.update(measurement))
        modes = self._modes
        modes.tick(self._period)
        ready = modes.are(Mode.STAND) & (modes.clock > STAND_SECONDS)
        modes.enter(ready & (self._made < self.hops), Mode.HOP)
        hopping = modes.are(Mode.HOP)
        if hopping.any():
            self._count_hops(leg, hopping)
        falling, met = self._landing.wait(leg, modes.clock)
        modes.enter(modes.are(Mode.FLY) & met, Mode.BRAKE)
        rested = modes.are(Mode.BRAKE) & (modes.clock > _BRAKE_SECONDS)
        self._from = np.where(rested[:, None], leg.q, self._from)
        modes.enter(rested, Mode.STAND)
        mode = modes.phase[:, None]
        torque = np.where(mode == Mode.STAND, self._stand(leg), 0.0)
        torque = np.where(mode == Mode.FLY, falling, torque)
        torque = np.where(mode == Mode.BRAKE, self._landing.brake(leg), torque)
        if self._controller is not None and modes.are(Mode.HOP).any():
            torque = np.where(mode == Mode.HOP, self._controller.act(measurement), torque)
        self._torque = torque
        return torque

    def internals(self) -> dict[str, Array]:
        """Return mode and hops counted at the last tick."""
        return {
            "mode": self._modes.phase.astype(np.float64),
            "counted_hops": self._made.astype(float),
        }

    def _count_hops(self, leg: virtual_leg.LegView, hopping: BoolArray) -> None:
        left = self._liftoff.update(leg, virtual_leg.leg_force(self.robot, leg.q, self._torque))
        self._made += left & hopping
        enough = hopping & (self._made >= self.hops)
        self._landing.begin(enough, leg.q)
        self._modes.enter(enough, Mode.FLY)

    def _stand(self, leg: virtual_leg.LegView) -> Array:
        target, _ = virtual_leg.retraction(
            self._from, self._posture, self._modes.clock, _RISE_SECONDS
        )
        weight = np.full(len(leg.q), self.robot.mass * GRAVITY)
        held: Array = self._stiffness * (target - leg.q) - self._damping * leg.qd
        return held + virtual_leg.foot_force_torque(self.robot, leg.q, weight, 0 * weight)
