"""What an excitation trajectory is: a class from time to joint angles."""

import math
from typing import Protocol

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording_format import Rig
from hopping_leg.robot.parameters import Robot


class Template(Protocol):
    """A trajectory of the joints."""

    @property
    def rig(self) -> Rig:
        """What the base is on."""
        ...

    @property
    def duration(self) -> float:
        """How long it lasts, s."""
        ...

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); NaN where the foot is out of reach."""
        ...


def require_positive(name: str, value: float) -> None:
    """Refuse a number that is not positive and finite.

    Raises:
        UsageError: Naming it.
    """
    if not 0 < value < math.inf:
        raise UsageError(f"'{name}' is {value:g} but must be positive and finite.")
