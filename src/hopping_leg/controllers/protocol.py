"""What a controller is: joint measurements and a command in, joint torques out."""

from typing import Protocol

from hopping_leg.arrays import Array
from hopping_leg.sim.channel import SAMPLES as SAMPLES
from hopping_leg.sim.channel import Measurement as Measurement
from hopping_leg.sim.plant import SoftLimiter as SoftLimiter


class Controller(Protocol):
    """Controls ``count`` legs at once; the real robot is a count of one."""

    name: str
    """Shown in tables and stored in traces."""

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        ...

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2); called once per control period."""
        ...

    def internals(self) -> dict[str, Array]:
        """Return what else is worth recording of the last ``act``, each (n,).

        Keys are trace columns and end in their unit: ``estimated_height_m``, ``phase``.
        """
        ...
