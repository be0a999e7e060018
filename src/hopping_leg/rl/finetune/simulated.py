"""A simulated leg that is reached like a real one: by trials that return what it measured.

The leg is stepped by the code that ``hop evaluate`` hops on. What the twin brings of latency and
noise is all there is; its true state goes nowhere but into ``HardwareTrial.truth``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, hardware_trial, protocol
from hopping_leg.controllers.rollout import Rollout, RolloutConfig, rollout
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import NO_NOISE, Simulator
from hopping_leg.sim.perturbation import Perturbation
from hopping_leg.trace import Trace

_BRAKING = 0.15
"""Damping of the joints once a leg was stopped, N m s/rad."""


@dataclass(frozen=True)
class Guard:
    """Beyond what measured joints end a trial; pairs are hip and knee, (2,) each."""

    lower: Array
    """rad"""
    upper: Array
    """rad"""
    speed: Array
    """rad/s"""
    braking: Array
    """How long before these angles a joint at its present speed must be braked, s."""

    def complaint(self, q: Array, qd: Array) -> str:
        """Return what is wrong with a leg's joints, rad and rad/s, (2,) each; empty if nothing."""
        ahead = q + self.braking * qd
        if (np.minimum(q, ahead) < self.lower).any() or (np.maximum(q, ahead) > self.upper).any():
            return "A joint left its range."
        if (np.abs(qd) > self.speed).any():
            return "A joint is faster than its motor can turn it."
        return ""


class SimulatedTrials:
    """A simulated leg that plays the real one, stopped by the guard if any; a ``TrialRobot``."""

    def __init__(self, robot: Robot, guard: Guard | None, threads: int = 1) -> None:
        self.name, self._robot, self._guard = robot.name, robot, guard
        self._setup = RolloutConfig(robot, NO_NOISE, threads=threads)

    def hop(
        self, controller: protocol.Controller, schedule: command_schedule.CommandSchedule, seed: int
    ) -> hardware_trial.HardwareTrial:
        """Let a controller hop from standing."""
        commands = schedule.commands(self._setup.rate)[:, None]
        witness = Witness(controller, self._guard)
        run = rollout(witness, self._setup, commands, seed)
        ended = int(witness.ended[0])
        trace = traces_of(run)[0]
        table = trace.table[: ended + 1] if ended >= 0 else trace.table
        return hardware_trial.HardwareTrial(
            Trace(table, trace.header),
            table.height / self._setup.rate,
            witness.complaints[0],
            _true_apexes(run, table.height),
        )


def hop_many(
    controller: protocol.Controller,
    robot: Robot,
    robots: Sequence[Robot],
    commands: Array,
    seed: int,
) -> Rollout:
    """Let a controller hop on many simulated legs, each a robot of its own, as if on ``robot``.

    Measured joints are columns, see ``traces_of``; commands are desired heights, m, (ticks, n).
    """
    calm = np.zeros(commands.shape)
    differ = Perturbation(tuple(robots), np.zeros((*commands.shape, 2)), calm, calm)
    setup = RolloutConfig(robot, NO_NOISE, timestep=1e-3, threads=1)
    return rollout(Witness(controller, None), setup, commands, seed, perturbation=differ)


def traces_of(run: Rollout) -> list[Trace]:
    """Return what each leg of a witnessed run measured, without anything true."""
    return [
        Trace(
            hardware_trial.measured_table(
                run.time,
                run.data["command_m"][:, leg],
                {
                    name: np.stack([run.data[_own(column)][:, leg] for column in columns], axis=1)
                    for name, columns in hardware_trial.MEASURED.items()
                },
            ),
            {**run.header, "simulated": True},
        )
        for leg in range(run.data["command_m"].shape[1])
    ]


class Witness:
    """Records what a controller is shown, and stops a leg where a guard objects.

    ``ended`` is the tick at which each leg was stopped, -1 for never, (n,); ``complaints`` say why.
    """

    def __init__(self, controller: protocol.Controller, guard: Guard | None) -> None:
        self.name, self._controller, self._guard = controller.name, controller, guard

    def watch(self, legs: Simulator) -> None:
        """Set the legs whose motors' torque is read."""
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget everything."""
        self._controller.reset(count)
        self.ended = np.full(count, -1)
        self.complaints = [""] * count
        self._tick = -1

    def act(self, measurement: protocol.Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        self._tick += 1
        q, qd = measurement.q[:, 0], measurement.qd[:, 0]
        asked = self._controller.act(measurement)
        seen = {"q": q, "qd": qd, "torque": self._legs.measured_torque, "asked": asked}
        self._seen = {name: np.array(values) for name, values in seen.items()}
        for leg in np.flatnonzero(self.ended < 0):
            if self._guard and (complaint := self._guard.complaint(q[leg], qd[leg])):
                self.ended[leg], self.complaints[leg] = self._tick, complaint
        stopped = (self.ended >= 0)[:, None]
        return np.where(stopped, -_BRAKING * qd, asked)

    def internals(self) -> dict[str, Array]:
        """Return what was seen at the last tick."""
        return {
            _own(column): self._seen[name][:, joint]
            for name, columns in hardware_trial.MEASURED.items()
            for joint, column in enumerate(columns)
        }


def _own(column: str) -> str:
    """Return the name of a measured column beside the true one of the same name."""
    return f"measured_{column}"


def _true_apexes(run: Rollout, ticks: int) -> Array:
    columns = ("height_m", "height_rate_m_s", "foot_clearance_m", "command_m")
    height, rate, clearance, command = (run.data[name][:ticks, 0] for name in columns)
    hops = find_hops(height, rate, clearance)
    return np.stack([run.time[hops.tick], command[hops.tick], hops.apex], axis=1)
