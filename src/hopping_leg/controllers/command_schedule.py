"""Which height is commanded when, and which heights a controller can be asked for."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import policy, protocol
from hopping_leg.errors import UsageError
from hopping_leg.robot import Robot, command_limits

Range = tuple[float, float]  # Lowest and highest, m


@dataclass(frozen=True)
class CommandSchedule:
    """Steps of (height in m, duration in s); the last height stays."""

    steps: tuple[tuple[float, float], ...]

    @staticmethod
    def parse(text: str) -> "CommandSchedule":
        """Read steps of height, m, and duration, s, e.g. ``0.25:5,0.30:5``, or raise UsageError."""
        steps = []
        for part in text.split(","):
            try:
                height, seconds = (float(number) for number in part.split(":"))
            except ValueError:
                height = seconds = math.nan
            if not (math.isfinite(height) and 0 < seconds < math.inf):
                raise UsageError(
                    f"'{part}' is no step of a schedule; give height in m and duration in s, e.g."
                    " 0.25:5,0.30:5."
                )
            steps.append((height, seconds))
        return CommandSchedule(tuple(steps))

    @property
    def seconds(self) -> float:
        """Length of all steps, s."""
        return sum(seconds for _, seconds in self.steps)

    def at(self, elapsed: float) -> float:
        """Return the height commanded at a time since the first hop, m."""
        for height, seconds in self.steps[:-1]:
            if elapsed < seconds:
                return height
            elapsed -= seconds
        return self.steps[-1][0]

    def commands(self, rate: float) -> Array:
        """Return the height commanded in every control period at a rate in Hz, m, (ticks,)."""
        return np.concatenate([np.full(round(s * rate), height) for height, s in self.steps])


def command_range(controller: protocol.Controller, robot: Robot) -> Range:
    """Return the heights that a controller can be asked for, m.

    A policy's are those of its training; others go from folded standing to twice the leg's length.
    """
    if isinstance(controller, policy.Policy):
        return controller.command_range
    return command_limits(robot)


def within(height: float, valid: Range) -> bool:
    """Tell whether a height, m, is in a range, but for rounding."""
    return valid[0] - 1e-9 <= height <= valid[1] + 1e-9


def check_heights(heights: Iterable[float], valid: Range, name: str) -> None:
    """Refuse heights, m, out of the range of a controller or robot by a UsageError."""
    for height in heights:
        if not within(height, valid):
            raise UsageError(
                f"'{name}' cannot be asked for {height:g} m; give heights from {valid[0]:.4g} to"
                f" {valid[1]:.4g} m."
            )
