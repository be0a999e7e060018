"""Stand, let a hopping controller hop so many times, catch the leg in the air, land, stand again.

A thin layer around any controller, since none was made to stand; it feels the joints alone.
"""

from enum import IntEnum

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.cartesian import foot_force_torque, leg_force
from hopping_leg.controllers.gain_files import load_gains
from hopping_leg.controllers.joint_observer import DatedObserver
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.controllers.landing import Landing, LandingGains
from hopping_leg.controllers.leg_view import LegView, view_leg
from hopping_leg.controllers.liftoff_detector import LiftoffDetector
from hopping_leg.controllers.posture import retraction
from hopping_leg.controllers.protocol import Controller, Measurement
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE

STAND_SECONDS = 1.0
"""The leg stands so long before it hops."""

_BRAKE_SECONDS = 0.4
"""After a touchdown spring and damper hold the leg so long."""

_RISE_SECONDS = 0.5
"""Of the way back to the standing posture."""


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
        landing: Of the landing.

    Raises:
        UsageError: The number of hops has no meaning.
    """

    def __init__(
        self,
        controller: Controller | None,
        robot: Robot,
        hops: int,
        *,
        rate: float = CONTROL_RATE,
        dropped: bool = False,
        landing: LandingGains | None = None,
    ) -> None:
        if hops < 0 or (hops > 0) == (controller is None):
            raise UsageError(f"{hops} hops make no sense here; give 1 or more, with a controller.")
        self.name = "landing" if controller is None else controller.name
        self.robot, self.hops, self._controller, self._period = robot, hops, controller, 1 / rate
        self._dropped, self._gains = dropped, landing
        setup = RolloutConfig(robot)
        self._standing, self._posture = setup.standing_length, setup.start_posture
        self._stiffness, self._damping = (np.array(g) for g in vars(JointGains()).values())
        self._observer = DatedObserver(self._period, load_gains().gains.position_pull)

    def reset(self, count: int) -> None:
        """Forget everything; the legs stand, or fall."""
        self._observer.reset(count)
        self._liftoff = LiftoffDetector(self.robot, self._period, count)
        self._landing = Landing(self.robot, count, self._standing, self._gains)
        self._mode = np.full(count, int(Mode.FLY if self._dropped else Mode.STAND))
        self._clock = np.full(count, self._landing.blind if self._dropped else 0.0)
        self._made = np.zeros(count, np.int64)
        self._from = np.tile(self._posture, (count, 1))
        self._torque = np.zeros((count, 2))
        if self._controller is not None:
            self._controller.reset(count)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        leg = view_leg(self.robot, self._observer.update(measurement))
        self._clock = self._clock + self._period
        self._hand_over()
        hopping = self._mode == Mode.HOP
        if hopping.any():
            self._count_hops(leg, hopping)
        falling, met = self._landing.wait(leg, self._clock)
        self._enter((self._mode == Mode.FLY) & met, Mode.BRAKE)
        rested = (self._mode == Mode.BRAKE) & (self._clock > _BRAKE_SECONDS)
        self._from = np.where(rested[:, None], leg.q, self._from)
        self._enter(rested, Mode.STAND)
        torque = np.zeros_like(leg.q)
        for mode, answer in (
            (Mode.STAND, self._stand(leg)),
            (Mode.FLY, falling),
            (Mode.BRAKE, self._landing.brake(leg)),
        ):
            torque = np.where((self._mode == mode)[:, None], answer, torque)
        if self._controller is not None and (self._mode == Mode.HOP).any():
            wanted = self._controller.act(measurement)
            torque = np.where((self._mode == Mode.HOP)[:, None], wanted, torque)
        self._torque = torque
        return torque

    def internals(self) -> dict[str, Array]:
        """Return mode and hops counted at the last tick."""
        return {"mode": self._mode.astype(np.float64), "counted_hops": self._made.astype(float)}

    def _hand_over(self) -> None:
        """Let all standing legs that have not hopped yet hop, once they have stood long enough."""
        ready = (self._mode == Mode.STAND) & (self._clock > STAND_SECONDS)
        self._enter(ready & (self._made < self.hops), Mode.HOP)

    def _count_hops(self, leg: LegView, hopping: BoolArray) -> None:
        left = self._liftoff.update(leg, leg_force(self.robot, leg.q, self._torque))
        self._made += left & hopping
        enough = hopping & (self._made >= self.hops)
        self._landing.begin(enough, leg.q)
        self._enter(enough, Mode.FLY)

    def _stand(self, leg: LegView) -> Array:
        target, _ = retraction(self._from, self._posture, self._clock, _RISE_SECONDS)
        weight = np.full(len(leg.q), self.robot.mass * GRAVITY)
        held: Array = self._stiffness * (target - leg.q) - self._damping * leg.qd
        return held + foot_force_torque(self.robot, leg.q, weight, 0 * weight)

    def _enter(self, who: BoolArray, mode: Mode) -> None:
        self._mode = np.where(who, int(mode), self._mode)
        self._clock = np.where(who, 0.0, self._clock)
