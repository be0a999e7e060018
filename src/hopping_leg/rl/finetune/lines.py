"""A line through points of which some lie far off, by least absolute errors."""

import numpy as np

from hopping_leg.arrays import Array

_ROUNDS = 30
_NEAR = 1e-3
"""Errors below which all points weigh the same, m."""


def robust_line(x: Array, y: Array, doubt: float = 0.0) -> Array:
    """Return constant and slope of the line, (2,).

    Args:
        x: (n,).
        y: m, (n,).
        doubt: Points' worth of evidence that the slope is zero.
    """
    columns = np.stack([np.ones_like(x), x], axis=1)
    ridge = np.diag([1e-9, 1e-9 + doubt])
    weight = np.ones_like(y)
    for _ in range(_ROUNDS):
        weighted = columns * weight[:, None]
        line = np.linalg.solve(weighted.T @ columns + ridge, weighted.T @ y)
        weight = 1 / np.maximum(np.abs(y - columns @ line), _NEAR)
        weight *= len(y) / weight.sum()
    return np.asarray(line)
