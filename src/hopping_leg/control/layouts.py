"""What a policy file asks for at every tick: named arrays made from the joint measurements.

A policy's metadata names its layout; the arrays are raw, in SI units. Normalisation is part of the
policy's graph, so that a policy file needs nothing but encoders and a command.
"""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hopping_leg.arrays import Array
from hopping_leg.errors import PolicyError, unknown_name
from hopping_leg.sim.disturbance import SAMPLES, Measurement

Inputs = dict[str, npt.NDArray[np.float32]]
"""Graph input to its array, (n, ...)."""


class Layout(Protocol):
    """Turns measurements into a policy's inputs; may remember past ticks."""

    name: str
    """As stored in policy files."""
    shapes: dict[str, tuple[int, ...]]
    """Graph inputs, in the order in which the network sees them, without the leading n."""

    def reset(self, count: int) -> None:
        """Forget the past; the next measurement has ``count`` rows."""
        ...

    def inputs(self, measurement: Measurement, last_torque: Array) -> Inputs:
        """Return the graph's inputs.

        Args:
            measurement: Of this tick.
            last_torque: What the policy asked for one tick ago, N m, (n, 2); zero after a reset.
        """
        ...


class ThreeSamples:
    """The paper's observation: position, velocity and command at three ticks, newest first."""

    name = "three-samples"

    def __init__(self) -> None:
        self.shapes: dict[str, tuple[int, ...]] = {
            "q": (SAMPLES, 2),
            "qd": (SAMPLES, 2),
            "command": (SAMPLES,),
        }

    def reset(self, count: int) -> None:
        """Do nothing: the measurement holds all three samples."""

    def inputs(self, measurement: Measurement, last_torque: Array) -> Inputs:
        """Return q and qd (n, 3, 2) in rad and rad/s, and command (n, 3) in m."""
        return {
            "q": measurement.q.astype(np.float32),
            "qd": measurement.qd.astype(np.float32),
            "command": measurement.command.astype(np.float32),
        }


LAYOUTS: dict[str, Any] = {ThreeSamples.name: ThreeSamples}
"""Layout names that policy files may carry, to their classes."""


def make_layout(name: str) -> Layout:
    """Return a fresh layout.

    Raises:
        PolicyError: No layout has that name.
    """
    if name not in LAYOUTS:
        raise PolicyError(unknown_name("observation layout", name, LAYOUTS))
    layout: Layout = LAYOUTS[name]()
    return layout
