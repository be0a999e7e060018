"""Many legs stepped at once on all cores."""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot.limits import MotorLimit
from hopping_leg.robot.model import TIMESTEP, build_model
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.any_legs import AnyLegs
from hopping_leg.sim.reality import RealLegs

CONTROL_RATE = 200.0
"""Control rate of the paper, Hz."""


class Legs(AnyLegs):
    """Legs in MuJoCo; results do not depend on the number of threads.

    ``measured_q`` and ``measured_qd`` are the true state, unless the robot's ``reality`` says
    otherwise.

    Commands that are late by a constant time are all of a ``reality`` that is simulated here; the
    rest is left to ``RealLegs``, which is slower.

    Args:
        robot: The leg.
        count: Number of simulations n.
        rate: Control rate, Hz; one ``step`` lasts ``1 / rate``.
        timestep: Physics step, s; must divide the control period.
        threads: Worker threads, 0 for one per core.
        clamped: Fix the base where it is placed, for fixed-base runs.
        variants: One robot per simulation, which may differ from ``robot`` in what ``sim.variants``
            lets vary; none simulates ``robot`` n times.

    Raises:
        UsageError: The physics step does not divide the control period, or the variants do not fit.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        rate: float = CONTROL_RATE,
        timestep: float = TIMESTEP,
        threads: int = 0,
        clamped: bool = False,
        variants: Sequence[Robot] = (),
    ) -> None:
        super().__init__(robot, count, rate, timestep)
        if robot.reality.only_delays and not clamped:
            self._take_model(threads, variants)
        elif variants:
            raise UsageError(
                f"Variants of {robot.name} cannot be simulated: it is clamped or has effects in"
                " [reality] beyond a delay; vary a robot without."
            )
        else:
            self._take_reality(clamped, threads)
        sensors = self if self.real is None else self.real.sensors
        self.measured_q, self.measured_qd = sensors.q, sensors.qd
        self._motors = MotorLimit(robot, count)
        self._inverse_belt = np.tile(1 / robot.of_joints("belt_ratio"), (count, 1))
        self._applied = np.zeros((count, 2))
        ticks, self._late = divmod(round(robot.reality.latency.command / timestep), self.substeps)
        self.waiting = np.zeros((ticks + 1, count, 2))
        """What the motors give until a late command arrives, and the commands under way, N m."""

    def _take_model(self, threads: int, variants: Sequence[Robot]) -> None:
        model = build_model(self.robot, self.timestep)
        self.batch = batch.Batch(model, self.count, threads)
        if variants:
            if len(variants) != self.count:
                raise UsageError(f"{len(variants)} variants were given for {self.count} legs.")
            self.batch.set_models([build_model(v, self.timestep) for v in variants])
        self._ctrl = self.batch.bind("ctrl")
        first = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        self._show(self.batch.state[:, first : first + 6])

    def _take_reality(self, clamped: bool, threads: int) -> None:
        self.real = RealLegs(
            self.robot,
            self.count,
            timestep=self.timestep,
            substeps=self.substeps,
            threads=threads,
            clamped=clamped,
        )
        self.batch = self.real.batch
        self._show(self.real.state)

    @property
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""
        return self._applied if self.real is None else self.real.sensors.torque

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a height and posture.

        Args:
            ids: Which legs.
            height: Of the base above the ground, m, (k,).
            q: Joint angles, rad, (k, 2) or (2,).
        """
        rows = np.arange(self.count)[ids]
        if self.real is not None:
            self.real.place(rows, height, q)
            return
        self._applied = np.zeros((self.count, 2))
        self.waiting[:, rows] = 0
        self.batch.reset(np.sort(rows), stage=0)
        self.height[ids] = height
        self.q[ids] = q

    def step(self, torque: Array) -> Array:
        """Hold joint torques for one control period; return what the motors gave, N m, (n, 2).

        Args:
            torque: Asked for at the joints, N m, (n, 2).

        Raises:
            mujoco.batch.SimulationError: Physics failed in some simulations.
        """
        if self.real is not None:
            return self.real.step(torque)
        if self._late or len(self.waiting) > 1:
            return self._step_late(torque)
        self._applied = applied = self._motors.clip(torque, self.qd)
        np.multiply(applied, self._inverse_belt, out=self._ctrl)
        self.batch.step(nstep=self.substeps)
        return applied

    def _step_late(self, torque: Array) -> Array:
        """Go on with the torques of before until later ones arrive; return their mean."""
        before, under_way = self.waiting[0], [*self.waiting[1:], torque]
        if self._late:
            np.multiply(before, self._inverse_belt, out=self._ctrl)
            self.batch.step(nstep=self._late)
        after = self._motors.clip(under_way[0], self.qd)
        np.multiply(after, self._inverse_belt, out=self._ctrl)
        self.batch.step(nstep=self.substeps - self._late)
        self._applied = after + self._late / self.substeps * (before - after)
        self.waiting = np.stack([after, *under_way[1:]])
        return self._applied
