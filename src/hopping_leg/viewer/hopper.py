"""One simulated leg with its controller, tick by tick, in a world that may change."""

import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array
from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import PhysicsError
from hopping_leg.robot.limits import SoftLimits
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE, MujocoSimulator, Plant
from hopping_leg.viewer.tracks import FIELDS
from hopping_leg.viewer.world import World

_ALL = slice(None)
_IMPOSSIBLE = 1e4
"""Joint speed that no leg reaches, rad/s."""


class Hopper:
    """A leg that hops.

    Args:
        controller: Believes that the leg is ``robot``.
        robot: The leg as its file has it.
        world: What it is in truth.
        height: Commanded first, m.
        seed: Of noise and random delay.
    """

    def __init__(
        self, controller: Controller, robot: Robot, world: World, height: float, seed: int
    ) -> None:
        self.controller, self.robot, self.world = controller, robot, world
        self._rng = np.random.default_rng(seed)
        self._force = 0.0
        self._make()
        self.stand(height)

    def stand(self, height: float) -> None:
        """Begin anew, standing; ``height`` is what is commanded, m."""
        self._legs.stand(_ALL, RolloutConfig(self.robot).start_posture)
        self._legs.push(np.zeros(1))
        self._force = 0.0
        self.take(self.controller, height)

    def take(self, controller: Controller, height: float) -> None:
        """Go on with another controller, or the same one anew, in the present state."""
        self.controller = controller
        controller.reset(1)
        self._plant.channel.restart(_ALL, self._legs.q, self._legs.qd, np.array([height]))

    def become(self, world: World, height: float) -> None:
        """Go on in another world, in the present state; the controller is not told."""
        state = self._legs.state.copy()
        self.world = world
        self._make()
        self._legs.place(_ALL, state[:, 0], state[0, 1:3])
        self._legs.state[:] = state
        self._legs.push(np.array([self._force]))
        self._plant.channel.restart(_ALL, self._legs.q, self._legs.qd, np.array([height]))

    def tick(self, height: float, force: float) -> Array:
        """Let one control period pass; return its row, (fields of a track,).

        Args:
            height: Commanded, m.
            force: Upward push on the base, N.

        Raises:
            PhysicsError: The simulation became unstable.
        """
        legs = self._legs
        if force != self._force:
            self._force = force
            legs.push(np.array([force]))
        command = np.array([height])
        row = np.empty(len(FIELDS))
        row[:3] = height, legs.height[0], legs.height_rate[0]
        row[3:5] = legs.q[0]
        row[7] = legs.foot_clearance()[0]
        torque = self.controller.act(self._plant.sense(command))
        try:
            row[5:7] = self._plant.drive(torque)[0]
        except batch.SimulationError as error:
            raise PhysicsError(f"The simulation of {self.robot.name} failed: {error}.") from error
        row[8] = self.controller.internals().get("phase", np.array([np.nan]))[0]
        if not np.abs(legs.qd).max() < _IMPOSSIBLE:
            raise PhysicsError(f"The simulation of {self.robot.name} became unstable.")
        return row

    def _make(self) -> None:
        self._legs = MujocoSimulator(self.world.of(self.robot), 1, rate=CONTROL_RATE, threads=1)
        self._plant = Plant(self._legs, self.world.disturbance, SoftLimits(), self._rng)
