"""Many legs stepped at once on all cores."""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, MotorLimit, Robot, build_model
from hopping_leg.sim.mismatch_model import JointFriction, friction_grows_with_load, set_model_fields
from hopping_leg.sim.mismatch_simulator import MismatchSimulator
from hopping_leg.sim.simulator import CONTROL_RATE, Engine, Ground, Simulator

_JOINTS = np.array([1, 2])
"""Degrees of freedom of hip and knee; the base comes first."""


class MujocoSimulator(Simulator):
    """Legs in MuJoCo; results do not depend on the number of threads, 0 for one per core.

    ``measured_q`` and ``measured_qd`` are the true state, unless the robot's ``reality`` says
    otherwise. Commands that are late by a constant time are all of a ``reality`` that is simulated
    here, and if legs differ in it, by whole control periods; the rest is left to
    ``MismatchSimulator``, which is slower.

    ``robots`` has one per simulation, which may differ from ``robot`` in what ``RANDOMIZABLE`` of
    ``sim.randomization`` names and in ``reality``. ``clamped`` fixes the base where it is placed.
    ``detailed`` leaves everything to ``MismatchSimulator``, so that ``set_robots`` takes any
    ``reality``.

    Raises:
        UsageError: The physics step does not divide the control period, or the robots do not fit.
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
        robots: Sequence[Robot] = (),
        detailed: bool = False,
    ) -> None:
        super().__init__(robot, count, rate, timestep)
        self.threads = threads
        if robots and (clamped or len(robots) != count):
            raise UsageError(
                f"{len(robots)} robots were given for {count} legs"
                f"{' that are clamped; robots hop' if clamped else '; give one for each'}."
            )
        if self._is_plain(robots) and not clamped and not detailed:
            self._take_model(threads, robots)
        else:
            self.mismatch = MismatchSimulator(
                robots or [robot] * count,
                timestep=timestep,
                substeps=self.substeps,
                threads=threads,
                clamped=clamped,
            )
            self.batch = self.mismatch.batch
            self._show(self.mismatch.state)
        sensors = self if self.mismatch is None else self.mismatch.sensors
        self.measured_q, self.measured_qd = sensors.q, sensors.qd
        self._motors = MotorLimit(robots or robot, count)
        self._inverse_belt = np.tile(1 / robot.of_joints("belt_ratio"), (count, 1))
        self._applied = np.zeros((count, 2))
        self._rows = np.arange(count)
        self.pending_torque = np.zeros((1, count, 2))
        """What the motors give until a late command arrives, and the commands under way, N m."""
        self._set_command_delay(robots or [robot] * count)

    def _take_model(self, threads: int, robots: Sequence[Robot]) -> None:
        model = build_model(self.robot, self.timestep)
        self.batch = batch.Batch(model, self.count, threads)
        if robots:
            self._set_models(robots)
        self._set_load_friction(robots or [self.robot] * self.count)
        self._ctrl = self.batch.bind("ctrl")
        first = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        self._show(self.batch.state[:, first : first + 6])

    def _set_models(self, robots: Sequence[Robot]) -> None:
        distinct = {id(robot): robot for robot in robots}
        models = {key: build_model(robot, self.timestep) for key, robot in distinct.items()}
        set_model_fields(self.batch, [models[id(robot)] for robot in robots])

    def _set_load_friction(self, robots: Sequence[Robot]) -> None:
        self._friction: JointFriction | None = None
        if friction_grows_with_load(robots):
            self._friction = JointFriction(robots, self.batch, _JOINTS)

    def _is_plain(self, robots: Sequence[Robot]) -> bool:
        """Tell whether delays are all that is beyond the model, if they differ by whole ticks."""
        robots = robots or [self.robot]
        rests = self._command_delays(robots) % self.substeps
        return not np.ptp(rests) and all(r.reality.only_delays for r in robots)

    def _command_delays(self, robots: Sequence[Robot]) -> IntArray:
        """Return by how many physics steps robots' commands are late, (n,)."""
        return np.array([round(r.reality.latency.command / self.timestep) for r in robots])

    @property
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""
        return self._applied if self.mismatch is None else self.mismatch.sensors.torque

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Go on as other robots, one per leg, in the present state.

        Raises:
            UsageError: They have effects that these legs cannot get while they move.
        """
        if self.mismatch is not None:
            self.mismatch.set_robots(robots)
        elif self._is_plain(robots):
            self._set_models(robots)
            self._set_load_friction(robots)
            self._motors = MotorLimit(robots, self.count)
            self._set_command_delay(robots)
        else:
            raise UsageError(
                f"Legs of {self.robot.name} cannot get another [reality] while they move; make"
                " them with 'detailed'."
            )

    def _set_command_delay(self, robots: Sequence[Robot]) -> None:
        """Let each leg's commands arrive as late as its robot's; none that is under way is lost."""
        late = self._command_delays(robots)
        self._late = int(late[0]) % self.substeps
        """Physics steps by which every command is late, on top of the ticks of each leg."""
        self.delay_ticks = late // self.substeps
        """Whole control periods by which each leg's commands are late, (n,)."""
        missing = int(self.delay_ticks.max()) + 1 - len(self.pending_torque)
        if missing > 0:
            self.pending_torque = np.concatenate(
                [self.pending_torque, np.zeros((missing, self.count, 2))]
            )

    def push(self, force: Array) -> None:
        """Push the bases upward from now on, N, (n,); not for clamped ones."""
        self.batch.bind("qfrc_applied")[:, 0] = force

    def raise_ground(self, rise: Array) -> None:
        """Raise the ground under each leg, m, (n,): the leg, whose height is above it, is lower."""
        self.height -= rise

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a height, m, and posture, rad."""
        rows = np.arange(self.count)[ids]
        if self.mismatch is not None:
            self.mismatch.place(rows, height, q)
            return
        self._applied = np.zeros((self.count, 2))
        self.pending_torque[:, rows] = 0
        self.batch.reset(np.sort(rows), stage=0)
        self.height[ids] = height
        self.q[ids] = q

    def step(self, torque: Array) -> Array:
        """Hold joint torques for one control period; return what the motors gave, N m, (n, 2).

        Raises:
            mujoco.batch.SimulationError: Physics failed in some simulations.
        """
        if self.mismatch is not None:
            return self.mismatch.step(torque)
        if self._late or len(self.pending_torque) > 1:
            return self._step_late(torque)
        self._applied = applied = self._motors.give(torque, self.qd)
        self._give(applied, self.substeps)
        return applied

    def _give(self, torque: Array, substeps: int) -> None:
        """Let the motors give joint torques, N m, (n, 2), for some physics steps."""
        np.multiply(torque, self._inverse_belt, out=self._ctrl)
        if self._friction is not None:
            self._friction.set(torque)
        self.batch.step(nstep=substeps)

    def _step_late(self, torque: Array) -> Array:
        """Go on with the torques of before until later ones arrive; return their mean."""
        before = self.pending_torque[0]
        under_way = np.concatenate([self.pending_torque[1:], np.zeros((1, self.count, 2))])
        under_way[self.delay_ticks, self._rows] = torque
        if self._late:
            self._give(before, self._late)
        after = self._motors.give(under_way[0], self.qd)
        self._give(after, self.substeps - self._late)
        self._applied = after + self._late / self.substeps * (before - after)
        self.pending_torque = np.concatenate([after[None], under_way[1:]])
        return self._applied


def make_simulator(
    robot: Robot,
    count: int,
    *,
    engine: Engine = "mujoco",
    ground: Ground = "robot",
    rate: float = CONTROL_RATE,
    timestep: float = TIMESTEP,
    threads: int = 0,
) -> Simulator:
    """Return legs in the engine and on the ground asked for.

    ``rate`` is the control rate, Hz, whose period the physics step, s, must divide. MuJoCo has
    worker ``threads``, 0 for one per core; PyBullet has one.

    Raises:
        UsageError: Engine and ground do not go together, or the engine refuses the robot.
    """
    check_ground(engine, ground)
    if engine == "mujoco":
        return MujocoSimulator(robot, count, rate=rate, timestep=timestep, threads=threads)
    # What runs on the robot shall not import what only PyBullet needs.
    from hopping_leg.sim.pybullet import PyBulletSimulator

    return PyBulletSimulator(robot, count, rate=rate, timestep=timestep, ground=ground)


def check_ground(engine: Engine, ground: Ground) -> None:
    """Refuse what MuJoCo has not.

    Raises:
        UsageError: Engine and ground do not go together.
    """
    if engine == "mujoco" and ground != "robot":
        raise UsageError(
            f"MuJoCo has no ground '{ground}', only 'robot'; take the engine pybullet, or a robot"
            " with another contact."
        )
