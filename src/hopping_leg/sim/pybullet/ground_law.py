"""The robot's ground as a force, for engines whose own contact is another one.

The ground of a robot file is a time constant T and a damping ratio zeta of MuJoCo's constraint.
With the penetration r < 0 of the foot, its velocity v and acceleration a where they touch, that is

    f = -m (a + b v + k d r),   b = 2 / (d_max T),   k = 1 / (d_max T zeta)^2,   m = d / ((1 - d) w)

with the impedance d, which grows from 0.9 to d_max = 0.95 over the first millimetre, and w the
inverse inertia of the shank in the straight leg: a spring, a damper and a mass of ground that the
foot takes along, some 12 kg for the paper's leg. So a foot under load hardly sinks deeper, which
no spring and damper alone does.

MuJoCo finds f without knowing a: with a0 as it were without the ground and the inverse inertia
A = J M^-1 J^T, (A + 1/m) f = -a0 - b v - k d r. Its cone of friction is a pyramid of four edges, of
which two lie in the leg's plane.
"""

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, build_model, dynamics, kinematics

_EDGES = np.array([2.0, 1.0, 1.0])
"""How many of the pyramid's edges push upwards, forwards and backwards."""

_SLOW = 1e-2
"""Speed below which Coulomb friction counts in proportion, rad/s and m/s."""


class GroundLaw:
    """Force of the robot's ground on the foot; knee and base are not its business.

    MuJoCo solves the joints' Coulomb friction together with the contact; here it is a load like
    any other, known from the speed.
    """

    def __init__(self, robot: Robot) -> None:
        model = build_model(robot)
        contact, floor = robot.contact, model.geom("floor")
        self._robot, self._slope = robot, contact.friction
        self._weakest, self._strongest, self._width = floor.solimp[:3]
        time = self._strongest * contact.time_constant
        self._damping = 2 / time
        self._stiffness = 1 / (time * contact.damping_ratio) ** 2
        self._inverse_mass = float(model.body("shank").invweight0[0])
        self._directions = np.array([[1, 0], [1, self._slope], [1, -self._slope]])
        joints = (robot.rail, robot.hip, robot.knee)
        self._viscous = np.array([joint.damping for joint in joints])
        self._coulomb = np.array([joint.friction for joint in joints])

    @property
    def spring(self) -> tuple[float, float]:
        """Stiffness, N/m, and damping, N s/m, of the ground once the foot is a millimetre in."""
        strongest = self._strongest
        mass = strongest / ((1 - strongest) * self._inverse_mass)
        return mass * strongest * self._stiffness, mass * self._damping

    def force(self, state: Array, torque: Array) -> Array:
        """Return the upward and forward force on the foot, N, (n, 2); see ``reach``.

        ``state`` is (x, q1, q2 and their rates), (n, 6), ``torque`` the joints', N m, (n, 2).
        """
        force = np.zeros((len(state), 2))
        depth = kinematics.foot_clearance(self._robot, state[:, 0], state[:, 1:3])
        touching = np.flatnonzero(depth < 0)
        if len(touching):
            force[touching] = self._solve(state[touching], torque[touching], depth[touching])
        return force

    def _solve(self, state: Array, torque: Array, depth: Array) -> Array:
        robot, q, speed = self._robot, state[:, 1:3], state[:, 3:6]
        jacobian = self._jacobian(q, depth)
        load = -dynamics.bias_force(robot, q, speed[:, 1:]) - self._viscous * speed
        load -= self._coulomb * np.clip(speed / _SLOW, -1, 1)
        load[:, 1:] += torque
        right = np.concatenate([np.swapaxes(jacobian, 1, 2), load[..., None]], axis=2)
        answer = jacobian @ np.linalg.solve(dynamics.mass_matrix(robot, q), right)
        inverse_inertia, unhindered = answer[..., :2], answer[..., 2]
        impedance = self._impedance(-depth)
        velocity = (jacobian @ speed[..., None])[..., 0]
        wanted = (-self._damping * velocity - unhindered) @ self._directions.T
        wanted -= (self._stiffness * impedance * depth)[:, None]
        soft = (1 - impedance) / impedance * self._inverse_mass
        matrix = self._directions @ inverse_inertia @ self._directions.T
        edges = 2 * self._slope**2 * (1 + self._slope**2) / _EDGES
        matrix[:, range(3), range(3)] += soft[:, None] * edges
        along = np.linalg.solve(matrix, wanted[..., None])[..., 0]
        for leg in np.flatnonzero((along < 0).any(axis=1)):
            along[leg] = _least(matrix[leg], wanted[leg])
        total: Array = along @ self._directions
        return total

    def reach(self, depth: Array) -> Array:
        """Return how far below the foot's centre the force acts: half way into the ground, m."""
        reach: Array = self._robot.foot.radius + np.minimum(depth, 0) / 2
        return reach

    def _jacobian(self, q: Array, depth: Array) -> Array:
        """Return d(up, forward)/dp of where the force acts, (k, 2, 3)."""
        of_centre = kinematics.jacobian(self._robot, q)
        jacobian = np.zeros((len(q), 2, 3))
        jacobian[:, 0, 0] = 1
        jacobian[:, 0, 1:] = -of_centre[:, 0]
        jacobian[:, 1, 1:] = of_centre[:, 1] + self.reach(depth)[:, None]
        return jacobian

    def _impedance(self, depth: Array) -> Array:
        """Return d: a curve of two parabolas, as MuJoCo's default has it."""
        share = np.minimum(depth / self._width, 1)
        rise = np.where(share < 0.5, 2 * share**2, 1 - 2 * (1 - share) ** 2)
        impedance: Array = self._weakest + (self._strongest - self._weakest) * rise
        return impedance


def _least(matrix: Array, target: Array) -> Array:
    """Minimise f A f / 2 - f b over f >= 0."""
    root = np.linalg.cholesky(matrix).T
    solution: Array = nnls(root, solve_triangular(root, target, trans=1))[0]
    return solution
