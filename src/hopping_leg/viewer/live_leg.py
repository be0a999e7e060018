"""A live simulation of one leg, or two side by side, that follow commands while they hop."""

from dataclasses import dataclass

import numpy as np

from hopping_leg.controllers import command_schedule, registry
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.io import replace_at
from hopping_leg.robot import Robot, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, LegSimulator, Measurement, NoiseAndDelay, Plant
from hopping_leg.sim.leg_simulator import IMPOSSIBLE_SPEED
from hopping_leg.viewer.tracks import FIELDS, KEPT, MOST, Track

PUSH_SECONDS = 0.05  # How long a push lasts

Range = command_schedule.Range

PAYLOAD: Range = (0.0, 1.0)  # on the base, kg
TIME_CONSTANT: Range = (0.005, 0.15)  # of the ground, from hard to soft, s
DELAY: Range = (0.0, 0.03)  # of commands, beyond the robot's own, s
PUSH: Range = (5.0, 60.0)  # N


@dataclass(frozen=True)
class LiveSettings:
    """Ground, payload, delay and noise beside the robot file; the controller is not told."""

    time_constant: float
    """Time constant of the ground, s; small is hard."""
    payload: float = 0.0
    """Mass on the base, kg."""
    delay: float = 0.0
    """Delay of commands beyond the robot's own, s."""
    noise: bool = True
    """The paper's noise and random delay of measurements."""

    def apply(self, robot: Robot) -> Robot:
        """Return the robot with these settings."""
        if robot.reality.ground.time_constant is not None:
            robot = replace_at(robot, "reality.ground.time_constant", self.time_constant)
        robot = replace_at(robot, "contact.time_constant", self.time_constant)
        robot = replace_at(robot, "base.mass", robot.base.mass + self.payload)
        delay = robot.reality.latency.command + self.delay
        return replace_at(robot, "reality.latency.command", delay)


def default_settings(robot: Robot) -> LiveSettings:
    """Return the settings of the robot file, its ground clipped to what can be set."""
    own = robot.reality.ground.time_constant or robot.contact.time_constant
    low, high = TIME_CONSTANT
    return LiveSettings(time_constant=min(max(own, low), high))


_ALL = slice(None)


class LiveSimulation:
    """The simulation behind the page; knows nothing of it.

    One or two controllers, names or files, believe the robot, a name or file, to be as its file has
    it, whatever the settings. ``valid`` are the heights, m, that all can be asked for; the one that
    is commanded first is brought into them. The seed is of noise and random delay.

    UsageError says that there is no such controller, or that they share no height, RobotError that
    there is no such robot, or that it cannot hop.
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
        self.begin(controllers, robot)

    def advance(self, seconds: float) -> None:
        """Let simulated time pass, in whole ticks."""
        for _ in range(round(seconds * CONTROL_RATE)):
            self.tick()

    def tick(self) -> None:
        """Let one control period pass; a leg that became unstable stands up again."""
        legs, rows = self._legs, np.empty((len(FIELDS), len(self.tracks)))
        legs.push(np.full(legs.count, self._force if self._push_ticks else 0.0))
        self._push_ticks = max(self._push_ticks - 1, 0)
        rows[:3] = np.full(legs.count, self.height), legs.height, legs.height_rate
        rows[3:5] = legs.q.T
        rows[7] = legs.foot_clearance()
        seen = self._plant.sense(rows[0])
        torques = [
            controller.act(Measurement(*(part[leg : leg + 1] for part in vars(seen).values())))
            for leg, controller in enumerate(self._controllers)
        ]
        rows[5:7] = self._plant.drive(np.concatenate(torques)).T
        for leg, track in enumerate(self.tracks):
            if np.abs(legs.qd[leg]).max() < IMPOSSIBLE_SPEED:
                track.extend(np.array([self.now]), rows[:, leg : leg + 1])
            else:
                self.notices.append(f"{track.name} became unstable. The leg stands up again.")
                self.stand(slice(leg, leg + 1))
        self.now += 1 / CONTROL_RATE

    def set_height(self, height: float) -> float:
        """Command a height, brought into what is valid; return it, m."""
        low, high = self.valid
        self.height = round(min(max(height, low), high), 4)
        return self.height

    def push(self, force: float) -> None:
        """Push the bases up, or down with a negative force, N, for ``PUSH_SECONDS``."""
        self._force, self._push_ticks = force, round(PUSH_SECONDS * CONTROL_RATE)

    def set_settings(self, settings: LiveSettings) -> None:
        """Change the settings while the legs hop; their controllers are not told."""
        self.settings = settings
        self._legs.set_robots([settings.apply(self.robot)] * self._legs.count)
        self._meet()

    def begin(self, names: tuple[str, ...], robot_name: str) -> None:
        """Begin anew, another robot with its own settings; on an error all stays as it was."""
        robot = load_robot(robot_name)
        robot.require_leg()
        if not 1 <= len(names) <= MOST:
            raise UsageError(f"{len(names)} controllers were given; give one, or two side by side.")
        controllers = [registry.load_controller(name, robot) for name in names]
        policies = (c for c in controllers if isinstance(c, Policy))
        self.notices += filter(None, (p.stranger(robot, p.name) for p in policies))
        ranges = [command_schedule.command_range(controller, robot) for controller in controllers]
        low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
        if not low < high:
            both = " and ".join(c.name for c in controllers)
            raise UsageError(
                f"{both} share no height that both can be asked for; show them in turn."
            )
        self.valid = low, high
        if robot != self.robot:
            self.settings = default_settings(robot)
        self.robot, self.robot_name, self.names = robot, robot_name, names
        self.set_height(self.height)
        self._controllers = controllers
        self.tracks = [Track(c.name, robot, depth=KEPT) for c in controllers]
        self._rng = np.random.default_rng(self._seed)
        changed = self.settings.apply(robot)
        self._legs = LegSimulator(changed, len(controllers), rate=CONTROL_RATE, threads=1)
        self._meet()
        self.stand()

    def stand(self, which: slice = _ALL) -> None:
        """Let legs begin anew, standing."""
        self._legs.stand(which, RolloutConfig(self.robot).start_posture)
        for controller in self._controllers[which]:
            controller.reset(1)
        self._restart(which)

    def _meet(self) -> None:
        """Let the controllers meet the legs through sensors, noise and delay."""
        disturbance = NoiseAndDelay() if self.settings.noise else NO_NOISE
        self._plant = Plant(self._legs, disturbance, SoftLimits(), self._rng)
        self._restart(_ALL)

    def _restart(self, legs: slice) -> None:
        q, qd = self._legs.q[legs], self._legs.qd[legs]
        self._plant.channel.restart(legs, q, qd, np.full(len(q), self.height))
