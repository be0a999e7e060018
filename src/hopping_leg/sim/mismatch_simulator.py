"""Legs that are more than the simulator for training knows: the physics behind ``[reality]``.

Backlash, belts    a further hinge with limit or spring (``mismatch_model``); both together a spring
                   with a dead band, numpy at each physics step
Masses, ground     other numbers of the same model
Friction           Stribeck's curve and the gears' load set MuJoCo's friction loss at each physics
                   step: its solver holds a joint at rest, which a torque computed before cannot
Motor, latency     numpy at each physics step, where order matters (``motor_effects``)
Encoders           numpy once per control period; the physics never sees them (``encoder_effects``)
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.encoder_effects import DRAWS, EncoderEffects
from hopping_leg.sim.mismatch_model import (
    JointFriction,
    friction_grows_with_load,
    mismatch_model,
    set_model_fields,
)  # fmt: skip
from hopping_leg.sim.motor_effects import MotorEffects


class MismatchSimulator:
    """Simulations of a leg with its ``reality``, stepped by one physics step at a time.

    ``state`` (n, 6) is (x, q1, q2 and rates) of base and links, as in ``MujocoSimulator``. It is a
    copy of the physics', renewed after each control period; what is written to it moves motor and
    link alike before the next.

    There is a robot per simulation; those that differ must agree in which joints have backlash or
    a belt, and have no stiction. A clamped base stays at the height where it was placed.

    Raises:
        UsageError: The robots cannot be simulated side by side.
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        *,
        timestep: float,
        substeps: int,
        threads: int,
        clamped: bool,
    ) -> None:
        self.count, self.substeps, self._timestep = len(robots), substeps, timestep
        real = mismatch_model(robots[0], timestep, clamped=clamped)
        self.batch = batch.Batch(real.model, self.count, threads)
        self._ctrl = self.batch.bind("ctrl")
        self._q, self._qd = self.batch.bind("qpos"), self.batch.bind("qvel")
        self._motor, self._flexible, self._clamped = real.motor, real.flexible, clamped
        self.state = np.zeros((self.count, 6))
        self._shown = np.zeros((self.count, 6))
        self.drive = MotorEffects(robots, timestep, substeps)
        self.sensors = EncoderEffects([robot.reality for robot in robots], timestep)
        self._inverse_belt = np.tile(1 / robots[0].of_joints("belt_ratio"), (self.count, 1))
        self._layout = _layout(robots[0])
        self._note(robots)
        self._set_models(robots, differ=any(r is not robots[0] for r in robots))
        self.reseed(np.random.default_rng(0))

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Go on as other robots, in the present state; commands under way stay under way.

        Raises:
            UsageError: They differ from the present ones in which joints have backlash or a belt,
                or one of them has stiction.
        """
        self._note(robots)
        self._set_models(robots, differ=True)
        self.drive.set_robots(robots)
        self.sensors.set_robots([robot.reality for robot in robots])

    def _set_models(self, robots: Sequence[Robot], *, differ: bool) -> None:
        if differ:
            set_model_fields(self.batch, self._models(robots))
        self._friction: JointFriction | None = None
        if self._excess.any() or friction_grows_with_load(robots):
            self._friction = JointFriction(robots, self.batch, self._motor)

    def _models(self, robots: Sequence[Robot]) -> list[mujoco.MjModel]:
        """Build every robot's model, once where legs share a robot."""
        distinct = {id(robot): robot for robot in robots}
        if any(_layout(robot) != self._layout for robot in distinct.values()):
            raise UsageError(
                "Legs with backlash or a belt and legs without cannot be simulated side by side;"
                " give all of them a small one."
            )
        if any((robot.reality.of_drives("stiction") > 1).any() for robot in distinct.values()):
            raise UsageError("Legs with stiction cannot differ or change; leave 'stiction' at 1.")
        models = {
            key: mismatch_model(robot, self._timestep, clamped=self._clamped).model
            for key, robot in distinct.items()
        }
        return [models[id(robot)] for robot in robots]

    def _note(self, robots: Sequence[Robot]) -> None:
        """Note what is computed here at each physics step: friction, springs with a dead band."""
        reality = robots[0].reality
        coulomb = robots[0].of_joints("friction")
        self._excess = coulomb * (reality.of_drives("stiction") - 1)
        self._stribeck = reality.of_drives("stiction_speed")
        stiffness, backlash = (
            np.array([robot.reality.of_drives(name) for robot in robots])
            for name in ("stiffness", "backlash")
        )
        both = [joint for joint, (slack, belt) in enumerate(self._layout) if slack and belt]
        self._slack = np.array([self._flexible[joint] for joint in both], np.int64)
        self._half_band, self._spring = backlash[:, both] / 2, stiffness[:, both]
        if both:
            self._spring_torque = self.batch.bind("qfrc_applied")

    def reseed(self, rng: np.random.Generator) -> None:
        """Take jitter and noise from here on from another source."""
        self.rng = rng

    def place(self, rows: IntArray, height: Array | float, q: Array) -> None:
        """Put legs at rest at a height, m, and posture, rad."""
        self.batch.reset(np.sort(rows), stage=0)
        self._shown[rows] = 0
        self.state[rows] = 0
        self.state[rows, 0] = height
        self.state[rows, 1:3] = q
        self.forget(rows)

    def forget(self, rows: IntArray) -> None:
        """Let some legs begin anew in their present state: no command under way, clean readings."""
        self._push()
        self.drive.forget(rows)
        self.sensors.forget(rows, self._q[:, self._motor], self._qd[:, self._motor])

    def step(self, torque: Array) -> Array:
        """Command joint torques for a control period; return their mean, N m, (n, 2)."""
        self._push()
        self.drive.take(torque, self.rng.random(self.count))
        mean = np.zeros((self.count, 2))
        for substep in range(self.substeps):
            q, qd = self._q[:, self._motor], self._qd[:, self._motor]
            given = self.drive.torque(substep, q, qd)
            if self._friction is not None:
                at_rest = np.exp(-np.square(qd / self._stribeck))
                self._friction.set(self.drive.motor_torque, self._excess * at_rest)
            if len(self._slack):
                angle = self._q[:, self._slack]
                beyond = angle - np.clip(angle, -self._half_band, self._half_band)
                self._spring_torque[:, self._slack] = -self._spring * beyond
            np.multiply(given, self._inverse_belt, out=self._ctrl)
            self.batch.step(nstep=1)
            self.sensors.watch(
                self._q[:, self._motor], self._qd[:, self._motor], self.drive.motor_torque
            )
            mean += (given - mean) / (substep + 1)
        self._show()
        self.sensors.read(self.rng.standard_normal((self.count, DRAWS)))
        return mean

    def _push(self) -> None:
        """Carry over what was written to ``state`` since it was shown."""
        change = self.state - self._shown
        if not change.any():
            return
        if not self._clamped:
            self._q[:, 0], self._qd[:, 0] = self.state[:, 0], self.state[:, 3]
        self._q[:, self._motor] += change[:, 1:3]
        self._qd[:, self._motor] += change[:, 4:6]
        self._shown[:] = self.state

    def _show(self) -> None:
        """Renew ``state``: a link's angle is its motor's plus the transmission's."""
        for first, coordinates in ((0, self._q), (3, self._qd)):
            if not self._clamped:
                self.state[:, first] = coordinates[:, 0]
            self.state[:, first + 1 : first + 3] = coordinates[:, self._motor]
            for joint, place in enumerate(self._flexible, first + 1):
                if place is not None:
                    self.state[:, joint] += coordinates[:, place]
        self._shown[:] = self.state

    def memory(self) -> dict[str, Any]:
        """Return what the physics' state lacks to go on exactly from here."""
        drive = {f"drive_{key}": value for key, value in self.drive.memory().items()}
        sensors = {f"sensors_{key}": value for key, value in self.sensors.memory().items()}
        return {**drive, **sensors, "reality_rng": self.rng.bit_generator.state}

    def restore(self, memory: dict[str, Any]) -> None:
        """Go on from a ``memory``; the physics' state must have been restored."""
        for part, prefix in ((self.drive, "drive_"), (self.sensors, "sensors_")):
            part.restore({k[len(prefix) :]: v for k, v in memory.items() if k.startswith(prefix)})
        self.rng.bit_generator.state = memory["reality_rng"]
        self._show()


def _layout(robot: Robot) -> list[tuple[bool, bool]]:
    """Return whether hip and knee have backlash and a belt, which decides the coordinates."""
    drives = (robot.reality.hip, robot.reality.knee)
    return [(drive.backlash > 0, drive.stiffness is not None) for drive in drives]
