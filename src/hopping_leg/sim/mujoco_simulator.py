"""The same leg in MuJoCo: the reference for the stepper."""

from collections.abc import Callable

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, Robot, compile_spec, get_spec
from hopping_leg.sim import stepper
from hopping_leg.sim.leg_table import leg_table
from hopping_leg.sim.simulator import CONTROL_RATE, Simulator


class MujocoSimulator(Simulator):
    """Legs in MuJoCo, whose motors obey their limits at every physics step.

    Args:
        robot: The legs; without ``reality``.
        count: Number of legs n.
        timestep: Physics step, s.
        threads: MuJoCo's threads, 0 for one per core.
        edit: Changes the model before it is compiled.

    Raises:
        UsageError: The robot has a ``reality``, or the physics step does not divide the period.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        timestep: float = TIMESTEP,
        threads: int = 0,
        edit: Callable[[mujoco.MjSpec], None] | None = None,
    ) -> None:
        super().__init__(robot, count, CONTROL_RATE, timestep)
        if not robot.reality.neutral or robot.boom.radius:
            raise UsageError(
                f"{robot.name} has a [reality] or a [boom], which MuJoCo does not simulate; take"
                " the stepper, LegSimulator."
            )
        spec = get_spec(robot, timestep)
        if edit is not None:
            edit(spec)
        for actuator in spec.actuators:
            actuator.ctrllimited = False
        # An unstable leg must be seen, not put back to where it began.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        model = compile_spec(spec, robot.name)
        self.batch = batch.Batch(model, count, threads)
        self._ctrl, self._force = self.batch.bind("ctrl"), self.batch.bind("qfrc_applied")
        self._friction = self.batch.expand("dof_frictionloss")[:, 1:]
        self._inverse_belt = 1 / robot.of_joints("belt_ratio")
        self._table = leg_table([robot] * count, timestep)
        self._given = np.zeros((count, 2))
        first = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        self._show(self.batch.state[:, first : first + 6])

    @property
    def measured_torque(self) -> Array:
        """What the motors give now, N m at the joints, (n, 2)."""
        return self._given

    def push(self, force: Array) -> None:
        """Push the bases upward from now on, N, (n,)."""
        self._force[:, 0] = force

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a base height, m, (k,), and joint angles, rad, (k, 2) or (2,)."""
        self.batch.reset(np.arange(self.count)[ids], stage=0)
        self._given[ids] = 0
        self.height[ids], self.q[ids] = height, q

    def step(self, torque: Array) -> Array:
        """Command joint torques for a control period; return the motors' mean, N m, (n, 2).

        Raises:
            mujoco.batch.SimulationError: Physics failed in some simulations.
        """
        total = np.zeros((self.count, 2))
        for _ in range(self.substeps):
            stepper.motor_torques(self._table, torque, self.qd, self._given, self._friction)
            np.multiply(self._given, self._inverse_belt, out=self._ctrl)
            self.batch.step(nstep=1)
            total += self._given
        return total / self.substeps
