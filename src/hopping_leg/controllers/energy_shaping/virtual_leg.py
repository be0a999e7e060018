"""The virtual leg of energy shaping, from hip to foot, and the state machine of the paper's Fig. 3.

The foot is pressed through the transposed Jacobian (paper, Eq. 7); in flight the joints move to the
landing posture on a smooth path, held there by a PD. Touchdown, without a sensor: the ground pushes
the leg together, or the flight PD resists it.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping.gains import ShapingGains
from hopping_leg.robot import Robot, kinematics


@dataclass(frozen=True)
class LegView:
    """State of n legs, all estimated."""

    q: Array
    """Joint positions, rad, (n, 2)."""
    qd: Array
    """Joint velocities, rad/s, (n, 2)."""
    length: Array
    """Distance of the foot below the hip, m, (n,)."""
    rate: Array
    """Its derivative, m/s, (n,)."""
    y: Array
    """Forward offset of the foot, m, (n,)."""
    y_rate: Array
    """Its derivative, m/s, (n,)."""
    stand: Array
    """Base height if the foot stood on hard ground, m, (n,)."""
    jacobian: Array
    """Of the foot's position below and in front of the hip, m, (n, 2, 2)."""


def view_leg(robot: Robot, q: Array, qd: Array) -> LegView:
    """Return the virtual leg of joint positions and velocities, rad, rad/s, (n, 2)."""
    foot = kinematics.foot_position(robot, q)
    jacobian = kinematics.jacobian(robot, q)
    speed = np.einsum("nij,nj->ni", jacobian, qd)
    stand = foot[:, 0] + robot.foot.radius
    return LegView(q, qd, foot[:, 0], speed[:, 0], foot[:, 1], speed[:, 1], stand, jacobian)


def leg_force(robot: Robot, leg: LegView, torque: Array) -> Array:
    """Return the force along the leg that joint torques, N m, (n, 2), press with at rest, N, (n,).

    The straight leg is singular; there the force of a slightly bent one is returned.
    """
    (a, b), (c, d) = np.moveaxis(leg.jacobian, 0, -1)
    determinant = a * d - b * c
    least = 0.1 * robot.thigh.length * robot.shank.length
    bounded = np.where(determinant < 0, -1.0, 1.0) * np.maximum(np.abs(determinant), least)
    force: Array = (d * torque[:, 0] - c * torque[:, 1]) / bounded
    return force


PUSH_LIMIT = 0.4  # longest push, s: a leg without lift-off by then gives up and tries afresh
FLIGHT_LIMIT = 0.5  # longest flight, s: that of a jump by 0.3 m; beyond it, touchdown was missed
BRAKE_LIMIT = 0.25  # longest touchdown, s: the velocity of an overdamped leg never turns


class Phase(IntEnum):
    """What a leg is doing; the value is recorded in traces."""

    LIFTOFF = 0
    """Pushes off, on the ground."""
    FLIGHT = 1
    """Moves to the landing posture, in the air."""
    TOUCHDOWN = 2
    """Brakes the fall, on the ground."""


class TouchdownDetector:
    """Watches how n legs leave the planned retraction, debounced by a median of three."""

    def __init__(self, robot: Robot, count: int, *, debounced: bool) -> None:
        self._robot = robot
        self._seen = np.zeros((3 if debounced else 1, 2, count))

    def update(self, leg: LegView, planned: Array, torque: Array, gains: ShapingGains) -> BoolArray:
        """Return which legs meet the ground, (n,): a soft one gives way, a stiff one resists.

        Planned are the joint velocities of the retraction, rad/s; torques are those of the flight
        PD, N m, (n, 2) each; the gains hold the thresholds.
        """
        self._seen[1:] = self._seen[:-1].copy()
        self._seen[0, 0] = leg.rate - np.einsum("ni,ni->n", leg.jacobian[:, 0], planned)
        self._seen[0, 1] = leg_force(self._robot, leg, torque)
        excess, force = np.sort(self._seen, axis=0)[len(self._seen) // 2]
        landed: BoolArray = (excess < gains.touchdown_rate) | (force > gains.touchdown_force)
        return landed
