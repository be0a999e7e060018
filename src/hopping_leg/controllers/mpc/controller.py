"""MPC on what a leg can know of itself: the planner on a particle filter's estimate."""

from collections.abc import Callable

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.mpc.particle_filter import FilterOptions, ParticleFilter
from hopping_leg.controllers.mpc.planner import HopShape, Planner, Planning
from hopping_leg.controllers.protocol import Measurement
from hopping_leg.robot import Robot
from hopping_leg.sim import CONTROL_RATE


class Mpc(Planner):
    """Controls legs by their joints alone: plans from a particle filter's mean state and leg."""

    name = "mpc"

    def __init__(
        self,
        robot: Robot,
        shape: HopShape | None = None,
        planning: Planning | None = None,
        options: FilterOptions | None = None,
        *,
        rate: float = CONTROL_RATE,
    ) -> None:
        super().__init__(robot, shape, planning, rate=rate)
        self.estimate = ParticleFilter(robot, self.period, options)
        """What is known of the legs."""

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        super().reset(count)
        self.estimate.reset(count)
        self._steps = np.full(count, self.estimate.options.steps)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        known = self.estimate
        known.update(measurement)

        def alone(work: Callable[[int, int], None]) -> None:
            work(0, len(measurement.q))

        command = np.ascontiguousarray(measurement.command[:, 0])
        tables = (known.rows, known.rows, self._steps)
        torque = self.plan(command, known.state, known.memory, tables, alone)
        known.send(torque)
        return torque

    def internals(self) -> dict[str, Array]:
        """Return the estimate, too."""
        known = self.estimate
        return {
            **super().internals(),
            "estimated_height_m": known.state[:, 0],
            "estimated_apex_m": known.apex,
        }
