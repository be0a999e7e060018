"""What may change in the world while a leg hops, unknown to its controller."""

import dataclasses
from dataclasses import dataclass

from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import NO_NOISE, NoiseAndDelay

Range = tuple[float, float]

PAYLOAD: Range = (0.0, 1.0)
"""Mass that can be put on the base, kg."""

TIME_CONSTANT: Range = (0.005, 0.15)
"""Of the ground, s: from hard to soft."""

DELAY: Range = (0.0, 0.03)
"""Further delay of commands, s."""

PUSH: Range = (5.0, 60.0)
"""Force of a push, N."""


@dataclass(frozen=True)
class World:
    """The world beside the robot file.

    Raises:
        UsageError: A value is out of its range.
    """

    time_constant: float
    """Of the ground, s; small is hard."""
    payload: float = 0.0
    """On the base, kg."""
    delay: float = 0.0
    """Of commands, beyond the robot's own, s."""
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
    def disturbance(self) -> NoiseAndDelay:
        """What befalls measurements and torques."""
        return NoiseAndDelay() if self.noise else NO_NOISE

    def of(self, robot: Robot) -> Robot:
        """Return what a robot is in this world."""
        reality = robot.reality
        latency = reality.latency
        ground = reality.ground
        if ground.time_constant is not None:
            ground = dataclasses.replace(ground, time_constant=self.time_constant)
        return dataclasses.replace(
            robot,
            base=dataclasses.replace(robot.base, mass=robot.base.mass + self.payload),
            contact=dataclasses.replace(robot.contact, time_constant=self.time_constant),
            reality=dataclasses.replace(
                reality,
                ground=ground,
                latency=dataclasses.replace(latency, command=latency.command + self.delay),
            ),
        )


def usual_world(robot: Robot) -> World:
    """Return the world of the robot file, its ground brought into what can be set."""
    own = robot.reality.ground.time_constant or robot.contact.time_constant
    low, high = TIME_CONSTANT
    return World(time_constant=min(max(own, low), high))
