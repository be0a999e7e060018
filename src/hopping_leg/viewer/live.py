"""A live simulation: one leg, or two side by side, that take commands while they hop."""

from hopping_leg.controllers.command_schedule import Range, command_range
from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.viewer.hopper import Hopper
from hopping_leg.viewer.tracks import Track
from hopping_leg.viewer.world import PUSH, World, usual_world

MOST = 2
"""Legs side by side."""

KEPT_SECONDS = 10.0
"""Of every leg's past."""

PUSH_SECONDS = 0.05
"""How long a push lasts."""


class Live:
    """The simulation behind the page; knows nothing of it.

    Attributes:
        robot: What the controllers believe.
        names: Of the controllers, as they were asked for.
        height: Commanded, m.
        world: What the legs are in.
        tracks: One per leg.
        now: Simulated time, s.
        notices: What the reader should be told; whoever shows them empties the list.

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
        self.world = usual_world(self.robot)
        self.names: tuple[str, ...] = ()
        self.tracks: list[Track] = []
        self._controllers: list[Controller] = []
        self._hoppers: list[Hopper] = []
        self._begin(controllers, self.robot)

    @property
    def valid(self) -> Range:
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
        for hopper, track in zip(self._hoppers, self.tracks, strict=True):
            try:
                track.append(self.now, hopper.tick(self.height, force))
            except PhysicsError as error:
                self.notices.append(f"{error} The leg stands up again.")
                hopper.stand(self.height)
        self.now += 1 / CONTROL_RATE

    def aim(self, height: float) -> float:
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

    def change_world(self, world: World) -> None:
        """Change the world while the legs hop; their controllers are not told."""
        self.world = world
        for hopper in self._hoppers:
            hopper.become(self.world, self.height)

    def stand(self) -> None:
        """Let all legs begin anew, standing."""
        for hopper in self._hoppers:
            hopper.stand(self.height)

    def take_controllers(self, names: tuple[str, ...]) -> None:
        """Go on with other controllers in the present state; another number of legs begins anew.

        Raises:
            UsageError: As for the constructor; everything stays as it was.
        """
        if len(names) != len(self.names):
            self._begin(names, self.robot)
            return
        loaded = _load(names, self.robot)
        _shared_range(loaded, self.robot)
        changed = [new != old for new, old in zip(names, self.names, strict=True)]
        self.names = names
        self._controllers = [
            new if other else old
            for new, old, other in zip(loaded, self._controllers, changed, strict=True)
        ]
        self.aim(self.height)
        for hopper, track, controller, other in zip(
            self._hoppers, self.tracks, self._controllers, changed, strict=True
        ):
            if other:
                track.name = controller.name
                hopper.take(controller, self.height)

    def take_robot(self, robot: str) -> None:
        """Begin anew with another robot in its own world.

        Raises:
            RobotError: As for the constructor; everything stays as it was.
        """
        self._begin(self.names, load_robot(robot))

    def _begin(self, names: tuple[str, ...], robot: Robot) -> None:
        robot.require_leg()
        loaded = _load(names, robot)
        _shared_range(loaded, robot)
        if robot != self.robot:
            self.world = usual_world(robot)
        self.robot, self.names, self._controllers = robot, names, loaded
        self.aim(self.height)
        self._hoppers = [Hopper(c, robot, self.world, self.height, self._seed) for c in loaded]
        depth = round(KEPT_SECONDS * CONTROL_RATE)
        self.tracks = [Track(c.name, robot, depth=depth) for c in loaded]


def _load(names: tuple[str, ...], robot: Robot) -> list[Controller]:
    if not 1 <= len(names) <= MOST:
        raise UsageError(f"{len(names)} controllers were given; give one, or two side by side.")
    return [load_controller(name, robot) for name in names]


def _shared_range(controllers: list[Controller], robot: Robot) -> Range:
    ranges = [command_range(controller, robot) for controller in controllers]
    low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
    if not low < high:
        names = " and ".join(controller.name for controller in controllers)
        raise UsageError(f"{names} share no height that both can be asked for; show them in turn.")
    return low, high
