"""Whether a leg stands and squats as its robot's file says, before it may hop.

The knee bends and stretches again while the hip keeps the foot's force upright. The torques tell
that force, which must be the leg's weight; the angles tell how the foot moves, which must roll on
one spot of the ground. A wrong sign, swapped drives, a wrong belt or zero breaks one of both,
unless the leg is the mirror image of the right one.
"""

import math
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.robot import Robot, dynamics, kinematics

DEPTH = 0.15  # Depth of the squat over the length of the standing leg
UPWARD = (0.85, 1.25)  # Shares of its file's weight that a leg may seem to carry

KNEE = (0.3, 1.8)
"""Shares of what is asked by which the knee may bend; the weight and friction change it."""

SIDEWAYS = (-0.22, 0.1)
"""Ways of the foot, forward and back, over the depth of the squat: below zero, as friction that the
file does not tell drags it over soft ground."""

DRIFT = 0.7  # Largest way of the foot from beginning to end of the squat, over its depth


@dataclass(frozen=True)
class SquatFindings:
    """What a squat looks like by the robot's file.

    Attributes:
        upward: Force on the foot over the weight.
        knee: Bending of the knee over what was asked.
        sideways: Way of the foot, forward and back, over the depth.
        drift: Way of the foot from beginning to end over the depth.
    """

    upward: float
    knee: float
    sideways: float
    drift: float

    def complaint(self, robot: Robot) -> str:
        """Return what is wrong with them, a sentence, or "" if nothing is."""
        ranges = (UPWARD, KNEE, SIDEWAYS, (-DRIFT, DRIFT))
        values = (self.upward, self.knee, self.sideways, self.drift)
        if all(low <= value <= high for value, (low, high) in zip(values, ranges, strict=True)):
            return ""
        return (
            f"by the file of {robot.name} it carries {self.upward:.0%} of its weight, and in a"
            f" squat its knee bends by {self.knee:.0%} of what is asked and its foot moves by"
            f" {self.sideways:.0%} of the depth to and fro and {self.drift:.0%} away; check mass,"
            " signs, CAN ids, gears, belt and zeros of both joints, and that the foot stands on"
            " the ground below the hip"
        )


def find(robot: Robot, bend: float, share: Array, q: Array, torque: Array) -> SquatFindings:
    """Return what a squat looks like by a robot's file.

    The knee was asked to bend by an angle, rad, at shares of the squat's time, (n,); joint angles,
    rad, and torques but for those against friction, N m, are (n, 2).
    """
    foot = kinematics.foot_position(robot, q)
    spot = foot[:, 1] + robot.foot.radius * q.sum(axis=1)  # a foot that rolls stays on its spot
    motion = np.stack([foot[:, 0], spot, q[:, 1]], axis=1)
    basis = np.stack([np.ones_like(share), _moving(share), share, _bent(share)], axis=1)
    (_, drift, _), (depth, sideways, knee) = np.linalg.lstsq(basis, motion)[0][2:]
    depth = max(-depth, 1e-6)
    upward = upward_force(robot, q, torque).mean()
    return SquatFindings(*map(float, (upward, knee / bend, sideways / depth, drift / depth)))


def upward_force(robot: Robot, q: Array, torque: Array) -> Array:
    """Return how a leg that stands pushes upward over its weight, (...); rad, N m, (..., 2)."""
    weight = dynamics.gravity_force(robot, q)
    transposed = np.swapaxes(kinematics.jacobian(robot, q), -1, -2)
    force = np.linalg.solve(transposed, (weight[..., 1:] - torque)[..., None])[..., 0]
    return -force[..., 0] / weight[..., 0]


@dataclass
class Squat:
    """Lets a leg squat, as its file says, and remembers how it did.

    It begins at a standing pose, rad, (2,), and takes so many seconds; the gains are of the joint
    PD, which bends the knee.
    """

    robot: Robot
    start: Array
    gains: JointGains
    seconds: float

    def __post_init__(self) -> None:
        down, forward = kinematics.foot_position(self.robot, self.start)
        bent = kinematics.joint_angles(self.robot, np.array([(1 - DEPTH) * down, forward]))
        self.bend = float(bent[1] - self.start[1])
        self._friction = np.array([self.robot.hip.friction, self.robot.knee.friction])
        self._friction *= np.sign(bent - self.start)
        self._samples: list[tuple[float, Array, Array]] = []

    def torque(self, lasted: float, q: Array, qd: Array) -> Array:
        """Return the joint torques, N m, (2,), at a time since the squat began, s."""
        share = np.array(lasted / self.seconds)
        target = self.start[1] + self.bend * _bent(share)
        knee = self.gains.stiffness[1] * (target - q[1]) - self.gains.damping[1] * qd[1]
        _, *gravity = dynamics.gravity_force(self.robot, q)
        hip_lever, knee_lever = kinematics.jacobian(self.robot, q)[0]
        lever = hip_lever / knee_lever if abs(hip_lever) < abs(knee_lever) else 0.0
        torque: Array = np.array([gravity[0] + lever * (knee - gravity[1]), knee])
        self._samples.append((float(share), q.copy(), torque))
        asked: Array = torque + _moving(share) * self._friction
        return asked

    def findings(self) -> SquatFindings:
        """Return what the squat looked like."""
        share, q, torque = (np.array(values) for values in zip(*self._samples, strict=True))
        return find(self.robot, self.bend, share, q, torque)


def _bent(share: Array) -> Array:
    """Return how far the knee is bent, 0 to 1, at a share of the squat's time."""
    return (1 - np.cos(2 * math.pi * share)) / 2


def _moving(share: Array) -> Array:
    """Return how fast the knee bends, over the fastest, at a share of the squat's time."""
    return np.sin(2 * math.pi * share)
