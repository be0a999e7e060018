"""A live simulation of one leg, or two side by side, that follow commands while they hop."""

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, protocol, registry
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.robot import Robot, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, LegSimulator, Plant
from hopping_leg.viewer.live_settings import PUSH, LiveSettings, default_settings
from hopping_leg.viewer.tracks import FIELDS, Track

MOST = 2
"""Legs side by side."""

KEPT_SECONDS = 10.0
"""Of every leg's past."""

PUSH_SECONDS = 0.05
"""How long a push lasts."""


class LiveSimulation:
    """The simulation behind the page; knows nothing of it.

    Args:
        controllers: One or two names or files.
        robot: Name or file.
        height: Commanded first, m; brought into what the controllers can be asked for.
        seed: Of noise and random delay, the same for both legs.

    Raises:
        UsageError: There is no such controller, or they share no height.
        RobotError: There is no such robot, or it cannot hop.
    """

    def __init__(
        self, controllers: tuple[str, ...], robot: str, height: float, seed: int = 0
    ) -> None:
        self.notices: list[str] = []
        self.now = 0.0
        self._seed = seed
        self._force, self._push_ticks = 0.0, 0
        self.height = height
        self.robot = load_robot(robot)
        self.settings = default_settings(self.robot)
        self.names: tuple[str, ...] = ()
        self._begin(controllers, self.robot)

    @property
    def valid(self) -> command_schedule.Range:
        """Heights that every controller can be asked for, m."""
        return _shared_range(self._controllers, self.robot)

    def advance(self, seconds: float) -> None:
        """Let simulated time pass, in whole ticks."""
        for _ in range(round(seconds * CONTROL_RATE)):
            self.tick()

    def tick(self) -> None:
        """Let one control period pass; a leg whose physics fails stands up again."""
        force = self._force if self._push_ticks else 0.0
        self._push_ticks = max(self._push_ticks - 1, 0)
        for leg, track in zip(self._legs, self.tracks, strict=True):
            try:
                track.append(self.now, leg.tick(self.height, force))
            except PhysicsError as error:
                self.notices.append(f"{error} The leg stands up again.")
                leg.stand(self.height)
        self.now += 1 / CONTROL_RATE

    def set_height(self, height: float) -> float:
        """Command a height, brought into what is valid; return it, m."""
        low, high = self.valid
        self.height = round(min(max(height, low), high), 4)
        return self.height

    def push(self, force: float) -> None:
        """Push the bases up, or down with a negative force, N, for ``PUSH_SECONDS``.

        Raises:
            UsageError: The force is too large to mean anything.
        """
        if not abs(force) <= PUSH[1]:
            raise UsageError(f"A push of {force:g} N is out of range; give up to {PUSH[1]:g} N.")
        self._force = force
        self._push_ticks = round(PUSH_SECONDS * CONTROL_RATE)

    def set_settings(self, settings: LiveSettings) -> None:
        """Change the settings while the legs hop; their controllers are not told."""
        self.settings = settings
        for leg in self._legs:
            leg.set_settings(self.settings, self.height)

    def stand(self) -> None:
        """Let all legs begin anew, standing."""
        for leg in self._legs:
            leg.stand(self.height)

    def set_controllers(self, names: tuple[str, ...]) -> None:
        """Go on with other controllers in the present state; another number of legs begins anew.

        Raises:
            UsageError: As for the constructor; everything stays as it was.
        """
        if len(names) != len(self.names):
            self._begin(names, self.robot)
            return
        loaded = _load(names, self.robot)
        _shared_range(loaded, self.robot)
        changed = [i for i, name in enumerate(names) if name != self.names[i]]
        self.names = names
        for i in changed:
            self._controllers[i] = loaded[i]
        self.set_height(self.height)
        for i in changed:
            self.tracks[i].name = loaded[i].name
            self._legs[i].set_controller(loaded[i], self.height)

    def set_robot(self, robot: str) -> None:
        """Begin anew with another robot and its own settings.

        Raises:
            RobotError: As for the constructor; everything stays as it was.
        """
        self._begin(self.names, load_robot(robot))

    def _begin(self, names: tuple[str, ...], robot: Robot) -> None:
        robot.require_leg()
        loaded = _load(names, robot)
        _shared_range(loaded, robot)
        if robot != self.robot:
            self.settings = default_settings(robot)
        self.robot = robot
        self.names = names
        self._controllers: list[protocol.Controller] = loaded
        self.set_height(self.height)
        self._legs: list[LiveLeg] = [
            LiveLeg(c, robot, self.settings, self.height, self._seed) for c in loaded
        ]
        depth = round(KEPT_SECONDS * CONTROL_RATE)
        self.tracks: list[Track] = [Track(c.name, robot, depth=depth) for c in loaded]


def _load(names: tuple[str, ...], robot: Robot) -> list[protocol.Controller]:
    if not 1 <= len(names) <= MOST:
        raise UsageError(f"{len(names)} controllers were given; give one, or two side by side.")
    return [registry.load_controller(name, robot) for name in names]


def _shared_range(controllers: list[protocol.Controller], robot: Robot) -> command_schedule.Range:
    ranges = [command_schedule.command_range(controller, robot) for controller in controllers]
    low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
    if not low < high:
        names = " and ".join(controller.name for controller in controllers)
        raise UsageError(f"{names} share no height that both can be asked for; show them in turn.")
    return low, high


_ALL = slice(None)
_IMPOSSIBLE = 1e4
"""Joint speed that no leg reaches, rad/s."""


class LiveLeg:
    """A leg that hops under a controller that believes it to be as its file has it."""

    def __init__(
        self,
        controller: protocol.Controller,
        robot: Robot,
        settings: LiveSettings,
        height: float,
        seed: int,
    ) -> None:
        self.controller, self.robot, self.settings = controller, robot, settings
        self._rng = np.random.default_rng(seed)
        self._force = 0.0
        self._legs = LegSimulator(settings.apply(robot), 1, rate=CONTROL_RATE, threads=1)
        self._connect()
        self.stand(height)

    def stand(self, height: float) -> None:
        """Begin anew, standing; ``height`` is what is commanded, m."""
        self._legs.stand(_ALL, RolloutConfig(self.robot).start_posture)
        self._legs.push(np.zeros(1))
        self._force = 0.0
        self.set_controller(self.controller, height)

    def set_controller(self, controller: protocol.Controller, height: float) -> None:
        """Go on with another controller, or the same one anew, in the present state."""
        self.controller = controller
        controller.reset(1)
        self._plant.channel.restart(_ALL, self._legs.q, self._legs.qd, np.array([height]))

    def set_settings(self, settings: LiveSettings, height: float) -> None:
        """Change the settings in the present state; the controller is not told."""
        self.settings = settings
        self._legs.set_robots([settings.apply(self.robot)])
        self._connect()
        self._plant.channel.restart(_ALL, self._legs.q, self._legs.qd, np.array([height]))

    def tick(self, height: float, force: float) -> Array:
        """Let one control period pass; return its row, (fields of a track,).

        ``height`` is what is commanded, m, ``force`` pushes the base up, N.

        Raises:
            PhysicsError: The simulation became unstable.
        """
        legs = self._legs
        if force != self._force:
            self._force = force
            legs.push(np.array([force]))
        row = np.empty(len(FIELDS))
        row[:3] = height, legs.height[0], legs.height_rate[0]
        row[3:5] = legs.q[0]
        row[7] = legs.foot_clearance()[0]
        torque = self.controller.act(self._plant.sense(np.array([height])))
        row[5:7] = self._plant.drive(torque)[0]
        row[8] = self.controller.internals().get("phase", np.array([np.nan]))[0]
        if not np.abs(legs.qd).max() < _IMPOSSIBLE:
            raise PhysicsError(f"The simulation of {self.robot.name} became unstable.")
        return row

    def _connect(self) -> None:
        self._plant = Plant(self._legs, self.settings.noise_and_delay, SoftLimits(), self._rng)
