"""A soft landing: the leg stretches in the air and, once it meets the ground, gives way.

In the air a joint PD, on the ground a virtual spring and damper from the hip to the foot:

    F = m g + k (l - l_leg) - d l_leg'
"""

from dataclasses import dataclass, fields

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.cartesian import foot_force_torque, leg_force
from hopping_leg.controllers.contact_detector import TouchdownDetector
from hopping_leg.controllers.gain_files import load_gains
from hopping_leg.controllers.leg_view import LegView
from hopping_leg.controllers.phases import FLIGHT_LIMIT
from hopping_leg.controllers.posture import per_joint, retraction
from hopping_leg.controllers.shaping_gains import scale_gains
from hopping_leg.errors import UsageError
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.robot.model import GRAVITY
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class LandingGains:
    """Of the landing, in units of the leg's weight, length and time (length / gravity)^(1/2).

    Raises:
        UsageError: A value has no meaning.
    """

    length: float = 0.85
    """Leg length at which the foot waits for the ground; a longer leg has more way to brake."""
    stiffness: float = 3.0
    """Of the spring."""
    damping: float = 1.5
    """Of the damper."""

    def __post_init__(self) -> None:
        for field in fields(self):
            if not 0 <= getattr(self, field.name) < float("inf"):
                raise UsageError(
                    f"'{field.name}' of the landing is {getattr(self, field.name)} but must be zero"
                    " or more and finite."
                )
        if not 0 < self.length < 1:
            raise UsageError(f"'length' of the landing is {self.length} but must be below 1.")


class Landing:
    """Lands n legs; flight PD, touchdown detection and retraction are those of energy shaping.

    Args:
        robot: The leg.
        count: Number of legs n.
        standing: Leg length to end at, m.
        gains: Of the landing.
    """

    def __init__(
        self, robot: Robot, count: int, standing: float, gains: LandingGains | None = None
    ) -> None:
        shipped = load_gains()
        self.robot = robot
        self._shared = scale_gains(shipped.gains, load_robot(shipped.robot), robot)
        gains = gains or LandingGains()
        reach = robot.thigh.length + robot.shank.length
        self._weight, self._standing = robot.mass * GRAVITY, standing
        self._stiffness = gains.stiffness * self._weight / reach
        self._damping = gains.damping * self._weight / np.sqrt(reach * GRAVITY)
        self._waiting = landing_posture(robot, gains)
        self._detector = TouchdownDetector(count, debounced=True)
        self._from = np.tile(self._waiting, (count, 1))

    def begin(self, who: BoolArray, q: Array) -> None:
        """Let some legs begin to move to the landing posture from where they are, rad, (n, 2)."""
        self._from = np.where(who[:, None], q, self._from)

    def wait(self, leg: LegView, clock: Array) -> tuple[Array, BoolArray]:
        """Return the torques of flight, N m, (n, 2), and which legs have met the ground, (n,).

        Args:
            leg: State of the legs.
            clock: Time since the legs left the ground, s, (n,).
        """
        gains = self._shared
        target, rate = retraction(self._from, self._waiting, clock, gains.retract_time)
        torque = per_joint(gains.hip_stiffness, gains.knee_stiffness) * (target - leg.q)
        torque += per_joint(gains.hip_damping, gains.knee_damping) * (rate - leg.qd)
        along = kinematics.jacobian(self.robot, leg.q)[:, 0]
        met = self._detector.update(
            leg.rate - np.einsum("ni,ni->n", along, rate),
            leg_force(self.robot, leg.q, torque),
            gains.touchdown_rate,
            gains.touchdown_force,
        )
        return torque, (met & (clock >= gains.flight_min)) | (clock > FLIGHT_LIMIT)

    def brake(self, leg: LegView) -> Array:
        """Return the torques of spring and damper, N m, (n, 2); they never pull the ground."""
        spring = self._stiffness * (self._standing - leg.length)
        push = np.maximum(self._weight + spring - self._damping * leg.rate, 0.0)
        side = -self._shared.kp_y * leg.y - self._shared.kd_y * leg.y_rate
        return foot_force_torque(self.robot, leg.q, push, side)

    @property
    def blind(self) -> float:
        """Time after lift-off in which no touchdown is believed, s."""
        return float(self._shared.flight_min)


def landing_posture(robot: Robot, gains: LandingGains | None = None) -> Array:
    """Return the posture in which a leg waits for the ground, foot below the hip, rad, (2,)."""
    length = (gains or LandingGains()).length * (robot.thigh.length + robot.shank.length)
    return kinematics.joint_angles(robot, np.array([length, 0.0]))
