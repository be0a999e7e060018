"""MPC in the true state of simulated legs, by shooting on the stepper."""

from dataclasses import replace

import numpy as np

from hopping_leg.arrays import Array, BoolArray, Records
from hopping_leg.controllers.mpc import hop_law
from hopping_leg.controllers.mpc.planner import Planner
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.errors import UsageError
from hopping_leg.robot import Robot
from hopping_leg.sim import LegSimulator, Simulator
from hopping_leg.sim.leg_table import leg_table


class TrueStateMpc(Planner):
    """Controls simulated legs whose true state it sees: what a perfect estimate would be worth.

    Plans are on the leg's true parameters. Legs that differ are planned for each as it is.
    """

    name = "mpc-true-state"

    def watch(self, legs: Simulator) -> None:
        """Take the legs, live.

        Raises:
            UsageError: They are not the stepper's.
        """
        if not isinstance(legs, LegSimulator):
            raise UsageError(
                "MPC in the true state plans on the stepper; let it meet a LegSimulator."
            )
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        super().reset(count)
        self._known: tuple[Robot, ...] = ()

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        return self.torque(measurement.command[:, 0])

    def torque(self, command: Array) -> Array:
        """Return joint torques for desired apexes, m, (n,), in the true state, N m, (n, 2)."""
        legs = self._legs
        if legs.robots is not self._known:
            self._plan_for(legs.robots)
        tables = (self._ground, self._air, self._steps)
        return self.plan(command, *self.look(), tables, legs.in_parallel)

    def _plan_for(self, robots: tuple[Robot, ...]) -> None:
        """Plan on the parameters of robots."""
        self._known, how = robots, self.planning
        self._air = leg_table([_rigid(robot) for robot in robots], how.timestep)
        self._ground = self._air.copy()
        self._steps = np.full(len(robots), round(self.period / how.timestep))
        elastic = np.flatnonzero(self._legs.table["elastic"].any(axis=1))
        if len(elastic):
            self._ground[elastic] = leg_table([robots[k] for k in elastic], how.elastic_timestep)
            self._steps[elastic] = round(self.period / how.elastic_timestep)

    @property
    def folding(self) -> BoolArray:
        """Which legs have to fold on the ground, (n,): they stand, or have pushed off."""
        legs = self._legs
        rests = (self._phase == hop_law.LANDING) & (np.abs(legs.height_rate) < hop_law.REST_SPEED)
        leaves = (self._phase == hop_law.FLIGHT) & (legs.foot_clearance() <= 0)
        folding: BoolArray = rests | leaves
        return folding

    def look(self) -> tuple[Array, Records]:
        """Return what plans begin with: states, (n, 6), and the stepper's memory, (n,)."""
        return self._legs.state, self._legs.records


def _rigid(robot: Robot) -> Robot:
    """Return a robot without elastic transmissions, whose springs need a finer physics step."""
    reality = robot.reality
    hip = replace(reality.hip, stiffness=None, backlash=0.0)
    knee = replace(reality.knee, stiffness=None, backlash=0.0)
    return replace(robot, reality=replace(reality, hip=hip, knee=knee))
