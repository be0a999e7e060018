"""Legs in PyBullet, another engine: does a controller lean on what only MuJoCo's physics does?"""

import weakref

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, MotorLimit, Robot, kinematics
from hopping_leg.sim.pybullet.ground_law import GroundLaw
from hopping_leg.sim.pybullet.world import PyBulletWorld
from hopping_leg.sim.simulator import CONTROL_RATE, Ground, Simulator


class PyBulletSimulator(Simulator):
    """Legs in PyBullet, each in a world of its own, one after the other.

    Dynamics, motors' limits, friction and damping are those of ``LegSimulator``, see
    ``pybullet_urdf``; stops are rigid; for the ground see ``ground_law``. Knee and base meet
    PyBullet's rigid ground where the foot meets the robot's, and else the foot's.

    Raises:
        UsageError: PyBullet is not installed, the physics step does not divide the control period,
            or the robot has a ``reality`` or friction that grows with load.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        rate: float = CONTROL_RATE,
        timestep: float = TIMESTEP,
        ground: Ground = "robot",
    ) -> None:
        super().__init__(robot, count, rate, timestep)
        friction = "a 'load_friction'" if robot.of_joints("load_friction").any() else ""
        if beyond := friction if robot.reality.neutral else "effects in [reality]":
            raise UsageError(
                f"{robot.name} has {beyond}, which only the stepper simulates; leave --engine out,"
                " or a robot without, e.g. legv2-paper."
            )
        law = GroundLaw(robot)
        self._law = law if ground == "robot" else None
        self._worlds = [
            PyBulletWorld(
                robot,
                timestep,
                spring=law.spring if ground == "spring" else None,
                foot_collides=ground != "robot",
            )
            for _ in range(count)
        ]
        self._finalizer = weakref.finalize(self, _close, self._worlds)
        self._show(np.zeros((count, 6)))
        self._known = np.full((count, 6), np.nan)
        self._motors = MotorLimit(robot)
        self._applied = np.zeros((count, 2))

    @property
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""
        return self._applied

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a height, m, and posture, rad."""
        self._applied = np.zeros((self.count, 2))
        self.state[ids] = 0
        self.height[ids] = height
        self.q[ids] = q

    def step(self, torque: Array) -> Array:
        """Command joint torques for a control period; return the motors' mean, N m, (n, 2)."""
        for moved in np.flatnonzero((self.state != self._known).any(axis=1)):
            self._worlds[moved].put(self.state[moved])
        total = np.zeros((self.count, 2))
        for _ in range(self.substeps):
            self._applied = self._motors.give(torque, self.qd)
            if self._law is not None:
                self._push(self._law, self._applied)
            for leg, world in enumerate(self._worlds):
                self.state[leg] = world.step(self._applied[leg], 1)
            total += self._applied
        self._known[:] = self.state
        return total / self.substeps

    def _push(self, law: GroundLaw, torque: Array) -> None:
        force = law.force(self.state, torque)
        pushed = np.flatnonzero(force.any(axis=1))
        if not len(pushed):
            return
        foot = kinematics.foot_position(self.robot, self.q[pushed])
        height = self.height[pushed] - foot[:, 0]
        height -= law.reach(height - self.robot.foot.radius)
        for row, leg in enumerate(pushed):
            self._worlds[leg].push(force[leg], np.array([height[row], foot[row, 1]]))


def _close(worlds: list[PyBulletWorld]) -> None:
    for world in worlds:
        world.close()
