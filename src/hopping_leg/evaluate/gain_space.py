"""The box in which the gains of energy shaping are searched."""

import dataclasses

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.shaping_gains import ShapingGains

SPACE: dict[str, tuple[float, float]] = {
    "exponent": (0.2, 2.0),
    "kp_y": (10.0, 400.0),
    "kd_y": (1.0, 20.0),
    "push_damping": (0.0, 100.0),
    "push_rate": (0.4, 1.3),
    "push_rate_slope": (0.0, 10.0),
    "liftoff_length": (0.17, 0.265),
    "liftoff_slope": (0.1, 1.0),
    "landing_length": (0.14, 0.235),
    "landing_slope": (0.0, 0.9),
    "retract_time": (0.03, 0.16),
    "hip_stiffness": (3.0, 25.0),
    "hip_damping": (0.05, 0.6),
    "knee_stiffness": (1.0, 8.0),
    "knee_damping": (0.0, 0.3),
    "touchdown_stiffness": (200.0, 2000.0),
    "touchdown_damping": (10.0, 80.0),
    "touchdown_rate": (-0.8, -0.2),
    "flight_min": (0.06, 0.17),
    "flight_min_slope": (0.0, 1.2),
    "position_pull": (0.05, 0.4),
}
"""Range of each searched gain; units as in ``ShapingGains``. What is not here stays as it is:
k0 only sets the first hops, the height calibration follows from the medians."""


def to_unit(gains: ShapingGains) -> Array:
    """Return the searched gains as a point in the unit cube."""
    low, high = np.array(list(SPACE.values())).T
    values = np.array([float(getattr(gains, name)) for name in SPACE])
    point: Array = np.clip((values - low) / (high - low), 0.0, 1.0)
    return point


def from_unit(point: Array, base: ShapingGains) -> ShapingGains:
    """Return ``base`` with the searched gains of a point in the unit cube."""
    low, high = np.array(list(SPACE.values())).T
    values = low + np.clip(point, 0.0, 1.0) * (high - low)
    return dataclasses.replace(base, **dict(zip(SPACE, values.tolist(), strict=True)))
