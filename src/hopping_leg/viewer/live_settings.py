"""Settings of a live simulation that change while the leg hops; its controller is not told."""

from dataclasses import dataclass, replace

from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import NO_NOISE, NoiseAndDelay

Range = tuple[float, float]

PAYLOAD: Range = (0.0, 1.0)  # on the base, kg
TIME_CONSTANT: Range = (0.005, 0.15)  # of the ground, from hard to soft, s
DELAY: Range = (0.0, 0.03)  # of commands, beyond the robot's own, s
PUSH: Range = (5.0, 60.0)  # N


@dataclass(frozen=True)
class LiveSettings:
    """Ground, payload, delay and noise beside the robot file.

    Raises:
        UsageError: A value is out of its range.
    """

    time_constant: float
    """Time constant of the ground, s; small is hard."""
    payload: float = 0.0
    """Mass on the base, kg."""
    delay: float = 0.0
    """Delay of commands beyond the robot's own, s."""
    noise: bool = True
    """The paper's noise and random delay of measurements."""

    def __post_init__(self) -> None:
        ranges = {"payload": PAYLOAD, "time_constant": TIME_CONSTANT, "delay": DELAY}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UsageError(
                    f"'{name}' is {value:g} but must lie between {low:g} and {high:g}."
                )

    @property
    def noise_and_delay(self) -> NoiseAndDelay:
        """Noise and delay of measurements and torques."""
        return NoiseAndDelay() if self.noise else NO_NOISE

    def apply(self, robot: Robot) -> Robot:
        """Return the robot with these settings."""
        reality = robot.reality
        latency, ground = reality.latency, reality.ground
        if ground.time_constant is not None:
            ground = replace(ground, time_constant=self.time_constant)
        return replace(
            robot,
            base=replace(robot.base, mass=robot.base.mass + self.payload),
            contact=replace(robot.contact, time_constant=self.time_constant),
            reality=replace(
                reality,
                ground=ground,
                latency=replace(latency, command=latency.command + self.delay),
            ),
        )


def default_settings(robot: Robot) -> LiveSettings:
    """Return the settings of the robot file, its ground clipped to what can be set."""
    own = robot.reality.ground.time_constant or robot.contact.time_constant
    low, high = TIME_CONSTANT
    return LiveSettings(time_constant=min(max(own, low), high))
