"""What the data can tell: intervals, correlations, and a plain statement of what stays open.

Near the best fit the residuals are r + J dv, so the values' covariance is s2 (J' J)^-1 with the
residuals' variance s2. Neighbouring samples are not independent; s2 is inflated by the residuals'
own correlation time, else the intervals would be far too narrow. Nor is the model right: what
another law of dry friction would make of the values is added to their intervals.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.parameters import ParameterSet

_NINETY_FIVE = 1.959963984540054
_UNTOLD = 0.5  # an interval wider than this share of value or scale, to either side, tells little
_TIED = 0.95  # correlation beyond which only a combination of two parameters is known
_SINGULAR = 1e-10
_NEAR = 0.01  # scales, or of a narrower range its share, from a bound that holds a value


@dataclass(frozen=True)
class Identifiability:
    """How well values are known."""

    names: list[str]
    values: Array
    """Best values, SI, (k,)."""
    half_width: Array
    """Half widths of the 95 % intervals, (k,); infinite where the data say nothing."""
    correlation: Array
    """(k, k)"""
    covariance: Array
    """SI, (k, k), to draw values from: its deviations are those of the intervals, for which what
    another law of friction would make of all values together counts, too."""
    at_bound: list[bool]
    """Whether a value stands at a bound of its search."""
    statements: list[str]
    """What these data cannot tell, a sentence each."""


def identifiability(
    parameters: ParameterSet, vector: Array, residuals: Array, jacobian: Array, change: Array
) -> Identifiability:
    """Judge a fit by its best search vector (k,), residuals there (m,) and their slopes (m, k).

    The ``change`` of the residuals, (m,), is what another model would make of them.
    """
    freedom = max(len(residuals) / correlation_time(residuals) - len(vector), 1.0)
    variance = float(np.sum(np.square(residuals))) / freedom
    norm = np.linalg.norm(jacobian, axis=0)
    safe = np.where(norm > 0, norm, 1.0)
    _, singular, directions = np.linalg.svd(jacobian / safe, full_matrices=False)
    weak = singular <= _SINGULAR * max(singular.max(initial=0.0), 1e-300)
    root = directions.T * np.where(weak, 0.0, 1 / np.where(weak, 1.0, singular))
    covariance = variance * (root @ root.T) / np.outer(safe, safe)
    blind = (norm == 0) | (np.abs(directions[weak]) > 1e-3).any(axis=0)  # part of such a direction
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)
    shift = covariance @ (jacobian.T @ change) / max(variance, 1e-300)
    half = _NINETY_FIVE * deviation + np.abs(shift)
    total = covariance + np.outer(shift, shift) / _NINETY_FIVE**2
    unit = parameters.scale_at(vector)
    wide = half / _NINETY_FIVE / np.sqrt(np.maximum(np.diag(total), 1e-300)) * unit
    half = np.where(blind, np.inf, half * unit)
    values, (low, high) = parameters.values(vector), parameters.bounds
    near = _NEAR * np.minimum(high - low, 1.0)
    at_bound = ((vector - low <= near) | (high - vector <= near)).tolist()
    known = (values, half, correlation, total * np.outer(wide, wide), at_bound)
    said = _statements(parameters, values, half, correlation)
    return Identifiability(parameters.names, *known, said)


def correlation_time(residuals: Array) -> float:
    """Return how many neighbouring residuals carry the information of one, at least 1."""
    centred = residuals - residuals.mean()
    power = float(np.mean(np.square(centred)))
    if power == 0.0:
        return 1.0
    total, count = 1.0, len(centred)
    for lag in range(1, min(count // 4, 1000)):
        share = float(np.mean(centred[lag:] * centred[:-lag])) / power
        if share < 0.05:
            break
        total += 2 * share
    return total


def _statements(
    parameters: ParameterSet, values: Array, half: Array, correlation: Array
) -> list[str]:
    said, names = [], parameters.names
    least = np.where(parameters.shares, 0.0, parameters.scale)
    sizes = np.maximum(np.abs(values), least)  # a value near zero is known, too
    for name, value, size, width in zip(names, values, sizes, half, strict=True):
        if not np.isfinite(width):
            said.append(f"These data say nothing about '{name}'.")
        elif width > _UNTOLD * size:
            said.append(
                f"'{name}' is {value:.3g} only to within {width:.2g}: these data hardly tell it."
            )
    for i, first in enumerate(names):
        for j in range(i):
            if abs(correlation[i, j]) > _TIED and np.isfinite(half[[i, j]]).all():
                sign = "sum" if correlation[i, j] < 0 else "difference"
                said.append(
                    f"'{names[j]}' and '{first}' trade off (correlation {correlation[i, j]:.2f}):"
                    f" only a weighted {sign} of them is known."
                )
    return said
