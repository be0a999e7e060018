"""The leg's own physics: many legs, which may differ in everything but their rates."""

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np

from hopping_leg.arrays import Array, IntArray, Records
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.robot import CONTROL_RATE, TIMESTEP, Robot, kinematics
from hopping_leg.sim import stepper
from hopping_leg.sim.compiled import announce
from hopping_leg.sim.lanes import WIDTH
from hopping_leg.sim.leg_table import LEG, leg_geometry, leg_table

IMPOSSIBLE_SPEED = 1e4  # Joint speed that no leg reaches, rad/s
_STEPS_PER_THREAD = 4000  # Physics steps for which it is worth waking another thread


class LegSimulator:
    """Legs in the compiled stepper; results do not depend on the number of threads.

    The robots' ``reality`` holds. What the encoders report is the true state of the motors' side
    unless a robot has noise, quantisation or latency of measurements. ``state`` (n, 6) is a live
    view of the true state (x, q1, q2 and their rates), and so are its parts ``height``,
    ``height_rate`` (n,), ``q`` and ``qd`` (n, 2), in m, m/s, rad and rad/s.

    Args:
        robot: What controllers believe.
        count: Number of legs n.
        rate: Control rate, Hz.
        timestep: Physics step, s.
        threads: Threads at most, 0 for one per core.
        fixed_base: Whether the bases stay where they are placed, where nothing touches the ground.
        robots: What each leg is, n of them; all ``robot`` if empty.

    Raises:
        RobotError: A transmission cannot be simulated at this physics step.
        UsageError: The physics step does not divide the control period, or robots are missing.
    """

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        rate: float = CONTROL_RATE,
        timestep: float = TIMESTEP,
        threads: int = 0,
        fixed_base: bool = False,
        robots: Sequence[Robot] = (),
    ) -> None:
        self.substeps = _substeps(rate, timestep)
        self.robot, self.count, self.rate, self.timestep = robot, count, rate, timestep
        self.period = 1 / rate
        if robots and len(robots) != count:
            raise UsageError(f"{len(robots)} robots were given for {count} legs; give one each.")
        self.threads, self.fixed_base = threads or os.cpu_count() or 1, fixed_base
        parts = min(self.threads, max(count, 1), 1 + count * self.substeps // _STEPS_PER_THREAD)
        groups = np.linspace(0, -(-count // WIDTH), parts + 1).astype(int)
        ends = np.minimum(groups * WIDTH, count).tolist()
        self._parts = list(itertools.pairwise(ends))
        self.state: Array = np.zeros((count, 6))
        self.height, self.height_rate = self.state[:, 0], self.state[:, 3]
        self.q, self.qd = self.state[:, 1:3], self.state[:, 4:6]
        self.records: Records = np.zeros(count, stepper.MEMORY)
        """What each leg remembers besides its state, live, (n,) of ``MEMORY``."""
        self._push = np.zeros(count)
        self.command = np.zeros((count, stepper.COMMAND))
        """What drives are commanded beside the torques that ``step`` takes, live."""
        self._jitter = np.zeros(count)
        self._reading = np.zeros((count, 6))
        self._past = np.zeros((count, 0, 6))
        self._disturbed = False
        self.rng = np.random.default_rng(0)
        """Source of jitter and sensor noise."""
        self.set_robots(robots or [robot] * count)
        compile_physics()

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Go on as other robots, one per leg, in the present state; commands stay under way.

        Sensors that are later than any before have no past beyond the present.

        Raises:
            RobotError: A transmission cannot be simulated at this physics step.
            UsageError: Commands are late by too many control periods.
        """
        table = leg_table(robots, self.timestep, fixed_base=self.fixed_base)
        latest = float((table["command_latency"] + table["command_jitter"]).max())
        if latest > (stepper.COMMANDS - 1) * self.period:
            raise UsageError(
                f"Commands that are {latest * 1e3:g} ms late do not fit a control period of"
                f" {self.period * 1e3:g} ms; at most {stepper.COMMANDS - 1} may be under way."
            )
        self.robots = tuple(robots)
        """What each leg is."""
        self.table = table
        self.geometry = leg_geometry(robots)
        """Lengths of the legs."""
        self._jitters = bool(table["command_jitter"].any())
        self._noisy = bool(table["sensor_noise"].any())
        late = bool(table["measurement_latency"].any())
        depth = 2 + int(np.ceil(table["measurement_latency"].max() / self.timestep)) if late else 0
        if depth > self._past.shape[1]:
            self._past = np.repeat(self._true_reading()[:, None], depth, axis=1)
            self.records["newest"] = 0.0
        disturbed = late or self._noisy or table["sensor_step"].any() or table["elastic"].any()
        if disturbed and not self._disturbed:
            self._reading[:] = stepper.rounded(self._true_reading(), table["sensor_step"])
        self._disturbed = bool(disturbed)

    def _true_reading(self) -> Array:
        """Return what undisturbed sensors would report, (n, 6)."""
        rotor = self.records["rotor"] if self._disturbed else self.state[:, [1, 2, 4, 5]]
        return np.concatenate([rotor, self.records["motor_torque"]], axis=1)

    @property
    def measured_q(self) -> Array:
        """Joint angles that the encoders report, rad, (n, 2)."""
        return self._reading[:, 0:2] if self._disturbed else self.q

    @property
    def measured_qd(self) -> Array:
        """Joint velocities that the encoders report, rad/s, (n, 2)."""
        return self._reading[:, 2:4] if self._disturbed else self.qd

    @property
    def measured_torque(self) -> Array:
        """What the motors' torque measurement reports now, N m at the joints, (n, 2)."""
        return self._reading[:, 4:6] if self._disturbed else self.records["motor_torque"]

    def push(self, force: Array) -> None:
        """Push the bases upward from now on, N, (n,)."""
        self._push[:] = force

    def raise_ground(self, rise: Array) -> None:
        """Raise the ground under each leg, m, (n,): the leg, whose height is above it, is lower."""
        self.height -= rise

    def place(self, ids: IntArray | slice, height: Array | float, q: Array) -> None:
        """Put legs at rest at a base height, m, (k,), and joint angles, rad, (k, 2) or (2,)."""
        self.state[ids] = 0
        self.height[ids], self.q[ids] = height, q
        self.forget(ids)

    def stand(self, ids: IntArray | slice, q: Array, clearance: Array | float = 0.0) -> None:
        """Put legs at rest in a posture with the foot ``clearance`` above the ground, m, (k,).

        A foot on the ground touches it by a nanometre, so that no rounding decides.
        """
        self.place(ids, kinematics.stance_height(self.robot, q) + clearance - 1e-9, q)

    def forget(self, ids: IntArray | slice) -> None:
        """Let legs begin anew in their state: no command under way, clean readings."""
        rows = np.arange(self.count)[ids]
        self.records[rows] = np.zeros((), stepper.MEMORY)
        rotor = self.state[rows][:, [1, 2, 4, 5]]
        self.records["rotor"][rows] = rotor
        self._reading[rows, :4], self._reading[rows, 4:] = rotor, 0
        self._past[rows] = self._reading[rows, None]
        step = self.table["sensor_step"][rows]
        self._reading[rows] = stepper.rounded(self._reading[rows], step)

    def step(self, torque: Array) -> Array:
        """Command joint torques for a control period; return the motors' mean, N m, (n, 2)."""
        self.command[:, :2] = torque
        if self._jitters:
            self._jitter = self.rng.random(self.count)
        self.in_parallel(
            lambda first, last: stepper.step_legs(
                self.table, self.state, self.records, self._past, self.command, self._jitter,
                self._push, first, last, self.substeps, self.timestep,
            )
        )  # fmt: skip
        self.read_sensors()
        return self.records["mean_torque"].copy()

    def require_stable(self, qd: Array) -> None:
        """Raise PhysicsError if joints had a speed, rad/s, that no leg reaches."""
        if not np.abs(qd).max() < IMPOSSIBLE_SPEED:
            raise PhysicsError(
                f"The simulation of {self.robot.name} became unstable at a physics step of"
                f" {self.timestep:g} s; take a smaller one, or check gains, masses and inertias."
            )

    def read_sensors(self) -> None:
        """Let the sensors report anew, with other noise; a step ends with it."""
        if self._disturbed:
            draws = self.rng.standard_normal((self.count, 6)) if self._noisy else self._reading
            stepper.read_sensors(
                self.table, self.records, self._past, draws, self._reading, self.timestep
            )

    def foot_clearance(self) -> Array:
        """Return the gap between each foot and the ground, m, (n,)."""
        return kinematics.foot_clearance(self.geometry, self.height, self.q)

    def knee_clearance(self) -> Array:
        """Return the gap between each knee and the ground, m, (n,)."""
        return kinematics.knee_clearance(self.geometry, self.height, self.q)

    def base_clearance(self) -> Array:
        """Return the gap between each base and the ground, m, (n,)."""
        return kinematics.base_clearance(self.geometry, self.height)

    def in_parallel(self, work: Callable[[int, int], None]) -> None:
        """Do something for the legs from a first to before a last one, on as many threads."""
        first, *others = self._parts
        # A fork has none of its parent's threads.
        futures = [_threads(os.getpid()).submit(work, *part) for part in others]
        work(*first)
        for future in futures:
            future.result()

    def memory(self) -> dict[str, Any]:
        """Return everything that is needed to go on exactly from here with the same robots."""
        return {
            "state": self.state.copy(),
            "push": self._push.copy(),
            "memory": self.records.view(np.float64).reshape(self.count, -1).copy(),
            "reading": self._reading.copy(),
            "past": self._past.copy(),
            "rng": self.rng.bit_generator.state,
        }

    def restore(self, memory: dict[str, Any]) -> None:
        """Go on from a ``memory``."""
        self.state[:], self._push[:] = memory["state"], memory["push"]
        self._reading[:] = memory["reading"]
        self.records.view(np.float64).reshape(self.count, -1)[:] = memory["memory"]
        self._past = np.array(memory["past"], np.float64, order="C")
        self.rng.bit_generator.state = memory["rng"]


def _substeps(rate: float, timestep: float) -> int:
    for name, value in (("control rate", rate), ("physics step", timestep)):
        if not 0 < value < np.inf:
            raise UsageError(f"The {name} is {value} but must be positive and finite.")
    substeps = round(1 / (rate * timestep))
    if substeps < 1 or abs(substeps * timestep * rate - 1) > 1e-9:
        raise UsageError(
            f"A physics step of {timestep} s does not divide the control period of"
            f" {1 / rate} s; take e.g. {1 / (rate * max(substeps, 1)):g} s."
        )
    return substeps


@cache
def compile_physics() -> None:
    """Compile the stepper before a first step, which may be one of a control loop.

    Before many processes simulate, one does it for all of them.
    """
    table, memory = np.zeros(0, LEG), np.zeros(0, stepper.MEMORY)
    rows, values, past = np.zeros((0, 6)), np.zeros(0), np.zeros((0, 0, 6))
    announce(stepper.step_legs, stepper.read_sensors)
    stepper.step_legs(table, rows, memory, past, rows, values, values, 0, 0, 1, TIMESTEP)
    stepper.read_sensors(table, memory, past, rows, rows, TIMESTEP)


@cache
def _threads(process: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix=f"stepper-{process}")
