"""What is to be read off: true quantities that no joint sensor measures."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping.phases import Phase
from hopping_leg.hop_detection import FLIGHT_CLEARANCE

Truth = dict[str, Array]


@dataclass(frozen=True)
class Target:
    """One quantity.

    Attributes:
        name: In tables.
        unit: Of a number; empty for classes.
        scale: From SI to ``unit``.
        values: Returns it of true columns at a control rate in Hz, (ticks, n); classes are whole
            numbers from 0, NaN does not count.
        classes: Number of classes, 0 for a number.
    """

    name: str
    unit: str
    scale: float
    values: Callable[[Truth, float], Array]
    classes: int = 0


def _flying(truth: Truth) -> BoolArray:
    flying: BoolArray = truth["foot_clearance_m"] >= FLIGHT_CLEARANCE
    return flying


def _contact(truth: Truth, _: float) -> Array:
    return (~_flying(truth)).astype(np.float64)


def _phase(truth: Truth, _: float) -> Array:
    """Return the phase of the paper's Fig. 3, from contact and the base's true velocity."""
    grounded = np.where(truth["height_rate_m_s"] > 0, Phase.LIFTOFF, Phase.TOUCHDOWN)
    return np.where(_flying(truth), Phase.FLIGHT, grounded).astype(np.float64)


def _until_touchdown(truth: Truth, rate: float) -> Array:
    """Return the time to the next touchdown, s; NaN on the ground and in a last, open flight."""
    flying = _flying(truth)
    left = np.full(flying.shape, np.nan)
    for tick in range(len(flying) - 2, -1, -1):
        ahead = np.where(flying[tick + 1], left[tick + 1] + 1 / rate, 1 / rate)
        left[tick] = np.where(flying[tick], ahead, np.nan)
    return left


def _in_flight(column: str) -> Callable[[Truth, float], Array]:
    return lambda truth, _: np.where(_flying(truth), truth[column], np.nan)


TARGETS = (
    Target("contact", "", 1.0, _contact, classes=2),
    Target("phase", "", 1.0, _phase, classes=3),
    Target("height", "mm", 1e3, lambda truth, _: truth["height_m"]),
    Target("height in flight", "mm", 1e3, _in_flight("height_m")),
    Target("vertical speed", "m/s", 1.0, lambda truth, _: truth["height_rate_m_s"]),
    Target("vertical speed in flight", "m/s", 1.0, _in_flight("height_rate_m_s")),
    Target("time to touchdown", "ms", 1e3, _until_touchdown),
)
"""Everything that is probed; on the ground, joints alone nearly give the height."""
