"""How many times larger one method's error is than another's, on the same twins."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hopping_leg.arrays import IntArray
from hopping_leg.evaluate.statistics import bootstrap


def compare(first: str, other: str, trials: Sequence[dict[str, Any]], seed: int) -> dict[str, Any]:
    """Return the ratio of two methods' errors, overall and at the command where it is smallest.

    Args:
        first: Name of the method that the other is compared with.
        other: Its name.
        trials: One row per method, twin, seed and command.
        seed: Of the bootstrap.

    Returns:
        Medians over all twins, seeds and commands; the interval resamples whole twins, so that both
        methods keep meeting the same ones.
    """
    twins = list(dict.fromkeys(row["twin"] for row in trials))
    errors = {
        method: [
            np.array([
                row["median_abs_error_m"]
                for row in trials
                if row["method"] == method and row["twin"] == twin
            ])
            for twin in twins
        ]
        for method in (first, other)
    }  # fmt: skip

    def ratio(index: IntArray) -> float:
        above, below = (
            np.median(np.concatenate([errors[method][int(i)] for i in index]))
            for method in (other, first)
        )
        return float(above / below)

    low = high = whole = ratio(np.arange(len(twins)))
    if len(twins) > 1:
        low, high = bootstrap((np.arange(len(twins)),), ratio, seed)
    return {
        "method": other,
        "over": first,
        "ratio": whole,
        "ratio_low": low,
        "ratio_high": high,
        "least_ratio_of_a_command": min(
            _at(trials, other, c) / _at(trials, first, c)
            for c in dict.fromkeys(row["command_m"] for row in trials)
        ),
    }


def _at(trials: Sequence[dict[str, Any]], method: str, command: float) -> float:
    """Return the median error of a method at a command, m."""
    rows = [row for row in trials if (row["method"], row["command_m"]) == (method, command)]
    return float(np.median([row["median_abs_error_m"] for row in rows]))
