"""An excitation with a flat spectrum."""

import math
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording_format import Pair, Rig
from hopping_leg.identify.templates import require_positive
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Multisine:
    """Harmonics with Schroeder phases around a posture: a flat spectrum with low peaks.

    Raises:
        UsageError: A number has no meaning.
    """

    centre: Pair
    """Posture, rad."""
    amplitude: Pair
    """Largest excursion, rad."""
    lowest: float = 0.1
    """Hz; also the spacing of the harmonics."""
    highest: float = 4.0
    """Hz."""
    duration: float = 60.0
    """s."""
    rig: Rig = "fixed-base"

    def __post_init__(self) -> None:
        for name in ("lowest", "duration"):
            require_positive(name, getattr(self, name))
        if not self.lowest < self.highest < math.inf:
            raise UsageError(f"'highest' is {self.highest:g} Hz but must exceed 'lowest'.")

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); hip and knee take turns by harmonic."""
        del robot
        count = math.floor(self.highest / self.lowest + 1e-9)
        orders: Array = np.arange(1.0, count + 1)
        angles = np.empty((len(time), 2))
        for joint in range(2):
            mine = orders[joint::2]
            index = np.arange(len(mine))
            phases = -np.pi * index * (index + 1) / max(1, len(mine))
            one = np.arange(2048) / (2048 * self.lowest)
            waves = [_wave(t, mine * self.lowest, phases) for t in (time, one)]
            scale = self.amplitude[joint] / max(np.abs(waves[1]).max(), 1e-12)
            fade = np.clip(np.minimum(time, self.duration - time) * self.lowest * 4, 0, 1)
            smooth = fade**3 * (10 - 15 * fade + 6 * fade**2)
            angles[:, joint] = self.centre[joint] + smooth * scale * waves[0]
        return angles


def _wave(time: Array, frequencies: Array, phases: Array) -> Array:
    wave: Array = np.cos(2 * np.pi * np.multiply.outer(time, frequencies) + phases).sum(axis=-1)
    return wave
