"""A live simulation of one leg, or two side by side, that follow commands while they hop."""

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, protocol, registry
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.robot import Robot, SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, LegSimulator, NoiseAndDelay, Plant, stepper
from hopping_leg.sim.compiled import FOLDER, say_compiling, was_compiled
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from hopping_leg.viewer.tracks import FIELDS, Track

MOST = 2
"""Legs side by side."""

KEPT_SECONDS = 10.0
"""Of every leg's past."""

PUSH_SECONDS = 0.05
"""How long a push lasts."""

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
        latency, ground = robot.reality.latency, robot.reality.ground
        if ground.time_constant is not None:
            ground = replace(ground, time_constant=self.time_constant)
        latency = replace(latency, command=latency.command + self.delay)
        return replace(
            robot,
            base=replace(robot.base, mass=robot.base.mass + self.payload),
            contact=replace(robot.contact, time_constant=self.time_constant),
            reality=replace(robot.reality, ground=ground, latency=latency),
        )


def default_settings(robot: Robot) -> LiveSettings:
    """Return the settings of the robot file, its ground clipped to what can be set."""
    own = robot.reality.ground.time_constant or robot.contact.time_constant
    low, high = TIME_CONSTANT
    return LiveSettings(time_constant=min(max(own, low), high))


def start_compiling() -> "subprocess.Popen[bytes] | None":
    """Begin to compile the stepper in another process; None if that was done or cannot be kept."""
    if FOLDER is None or was_compiled(stepper.step_legs):
        return None
    say_compiling()
    code = "import os; getattr(os, 'nice', int)(10)\n"  # the page goes first
    code += "from hopping_leg.sim.leg_simulator import compile_physics; compile_physics()"
    return subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)


class LiveSimulation:
    """The simulation behind the page; knows nothing of it.

    Args:
        controllers: One or two names or files.
        robot: Name or file.
        height: Commanded first, m; brought into what the controllers can be asked for.
        seed: Of noise and random delay, the same for both legs.
        at_once: Let MuJoCo simulate while the stepper is being compiled, if it never was here.

    Raises:
        UsageError: There is no such controller, or they share no height.
        RobotError: There is no such robot, or it cannot hop.

    Attributes:
        valid: Heights that every controller can be asked for, m.
    """

    def __init__(
        self,
        controllers: tuple[str, ...],
        robot: str,
        height: float,
        seed: int = 0,
        *,
        at_once: bool = False,
    ) -> None:
        self.notices: list[str] = []
        self.now = 0.0
        self._seed = seed
        self._force, self._push_ticks = 0.0, 0
        self.height = height
        self.robot = load_robot(robot)
        self.settings = default_settings(self.robot)
        self.names: tuple[str, ...] = ()
        self._compiling = start_compiling() if at_once else None
        self._in_mujoco = False
        self.begin(controllers, robot)

    def advance(self, seconds: float) -> None:
        """Let simulated time pass, in whole ticks."""
        if self._compiling is not None and self._compiling.poll() is not None:
            self._compiling, self._in_mujoco = None, False
            self._go_on()
        for _ in range(round(seconds * CONTROL_RATE)):
            self.tick()

    def tick(self) -> None:
        """Let one control period pass; a leg whose physics fails stands up again."""
        force = self._force if self._push_ticks else 0.0
        self._push_ticks = max(self._push_ticks - 1, 0)
        for leg, track in zip(self._legs, self.tracks, strict=True):
            try:
                row = leg.tick(self.height, force)
                track.extend(np.array([self.now]), row[:, None])
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
        """Push the bases up, or down with a negative force, N, for ``PUSH_SECONDS``."""
        self._force = force
        self._push_ticks = round(PUSH_SECONDS * CONTROL_RATE)

    def set_settings(self, settings: LiveSettings) -> None:
        """Change the settings while the legs hop; their controllers are not told.

        Raises:
            UsageError: The physics that knows of such settings is still being compiled.
        """
        if self._in_mujoco and not settings.apply(self.robot).reality.neutral:
            raise UsageError("Delays can be set once the leg's physics is compiled, in seconds.")
        self.settings = settings
        self._go_on()

    def stand(self) -> None:
        """Let all legs begin anew, standing."""
        for leg in self._legs:
            leg.stand(self.height)

    def begin(self, names: tuple[str, ...], robot_name: str) -> None:
        """Begin anew with controllers on a robot; another robot has its own settings.

        Raises:
            UsageError, RobotError: As for the constructor; everything stays as it was.
        """
        robot = load_robot(robot_name)
        robot.require_leg()
        if not 1 <= len(names) <= MOST:
            raise UsageError(f"{len(names)} controllers were given; give one, or two side by side.")
        loaded = [registry.load_controller(name, robot) for name in names]
        self.valid = _shared_range(loaded, robot)
        if robot != self.robot:
            self.settings = default_settings(robot)
        self.robot, self.robot_name, self.names = robot, robot_name, names
        self.set_height(self.height)
        changed = self.settings.apply(robot)
        self._in_mujoco = self._compiling is not None and changed.reality.neutral
        self._legs = [LiveLeg(c, changed, self._seed, in_mujoco=self._in_mujoco) for c in loaded]
        self._go_on()
        self.stand()
        depth = round(KEPT_SECONDS * CONTROL_RATE)
        self.tracks = [Track(c.name, robot, depth=depth) for c in loaded]

    def _go_on(self) -> None:
        changed = self.settings.apply(self.robot)
        noise_and_delay = NoiseAndDelay() if self.settings.noise else NO_NOISE
        for leg in self._legs:
            leg.go_on(changed, noise_and_delay, self.height, in_mujoco=self._in_mujoco)


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
        self, controller: protocol.Controller, robot: Robot, seed: int, *, in_mujoco: bool
    ) -> None:
        self.controller = controller
        self._rng = np.random.default_rng(seed)
        self._force = 0.0
        self._legs = _simulator(robot, in_mujoco=in_mujoco)

    def stand(self, height: float) -> None:
        """Begin anew, standing; ``height`` is what is commanded, m."""
        self._legs.stand(_ALL, RolloutConfig(self._legs.robot).start_posture)
        self._legs.push(np.zeros(1))
        self._force = 0.0
        self.controller.reset(1)
        self._restart(height)

    def go_on(
        self, robot: Robot, noise_and_delay: NoiseAndDelay, height: float, *, in_mujoco: bool
    ) -> None:
        """Go on as a changed robot in the present state; the controller is not told."""
        legs = self._legs
        if isinstance(legs, LegSimulator):
            legs.set_robots([robot])
        else:
            self._legs = _simulator(robot, in_mujoco=in_mujoco)
            self._legs.state[:] = legs.state
            self._legs.forget(_ALL)
            self._legs.push(np.array([self._force]))
        self._plant = Plant(self._legs, noise_and_delay, SoftLimits(), self._rng)
        self._restart(height)

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
            raise PhysicsError(f"The simulation of {legs.robot.name} became unstable.")
        return row

    def _restart(self, height: float) -> None:
        self._plant.channel.restart(_ALL, self._legs.q, self._legs.qd, np.array([height]))


def _simulator(robot: Robot, *, in_mujoco: bool) -> LegSimulator | MujocoSimulator:
    kind = MujocoSimulator if in_mujoco else LegSimulator
    return kind(robot, 1, rate=CONTROL_RATE, threads=1)
