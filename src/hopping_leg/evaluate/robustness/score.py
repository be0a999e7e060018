"""Shares of successful trials and how sure they are."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from hopping_leg.arrays import Array
from hopping_leg.evaluate.robustness.outcome import Outcome
from hopping_leg.evaluate.statistics import CONFIDENCE, RESAMPLES

OVERALL = "overall"
"""Row of the mean over all axes."""


def share(axes: Sequence[Sequence[Array]], seed: int) -> tuple[float, float, float]:
    """Return the mean over axes of the mean over levels of the share of successes.

    Args:
        axes: Per axis and level: 1 for every successful trial, 0 for the others, (trials,).
        seed: Of the bootstrap.

    Returns:
        The share, and its 95 % bootstrap interval, in which trials are resampled within their
        level; NaN for the interval where a level has one trial alone.
    """
    levels = [level for axis in axes for level in axis]
    weights = np.array([1 / len(axis) for axis in axes for _ in axis]) / len(axes)

    def statistic(*samples: Array, axis: int) -> Array:
        return weights @ np.stack([sample.mean(axis=axis) for sample in samples])  # type: ignore[no-any-return]

    score = float(weights @ [level.mean() for level in levels])
    if any(len(level) < 2 for level in levels):
        return score, float("nan"), float("nan")
    found = stats.bootstrap(
        levels,
        statistic,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return score, float(found.low), float(found.high)


def by_level(outcomes: Sequence[Outcome]) -> dict[float, list[Outcome]]:
    """Return the trials of every level, by rising level."""
    return {
        level: [one for one in outcomes if one.level == level]
        for level in sorted({one.level for one in outcomes})
    }


def successes(outcomes: Sequence[Outcome]) -> list[Array]:
    """Return 1 for every successful trial, 0 for the others, per level, (trials,) each."""
    return [
        np.array([one.success for one in group], np.float64)
        for group in by_level(outcomes).values()
    ]


def level_rows(controller: str, axis: str, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return what is told of each level of an axis, by rising level."""
    return [
        {
            "controller": controller,
            "axis": axis,
            "level": level,
            "success": float(np.mean([one.success for one in group])),
            "median_abs_error_m": _median_size([one.error_m for one in group]),
            "skipped_hops": sum(one.skipped for one in group),
            "body_contacts": sum(one.contacts for one in group),
            "trials": len(group),
        }
        for level, group in by_level(outcomes).items()
    ]


def score_rows(
    controller: str, outcomes: dict[str, list[Outcome]], seed: int
) -> list[dict[str, Any]]:
    """Return a controller's score on every axis, and overall.

    Args:
        controller: As named on the command line.
        outcomes: Trials by axis.
        seed: Of the bootstrap.
    """
    levels = {axis: successes(found) for axis, found in outcomes.items()}
    rows = [_row(controller, axis, [groups], seed) for axis, groups in levels.items()]
    return [*rows, _row(controller, OVERALL, list(levels.values()), seed)]


def _row(
    controller: str, axis: str, groups: Sequence[Sequence[Array]], seed: int
) -> dict[str, Any]:
    score, low, high = share(groups, seed)
    return {
        "controller": controller,
        "axis": axis,
        "score": score,
        "low": low,
        "high": high,
        "trials": sum(len(level) for levels in groups for level in levels),
    }


def _median_size(errors: Sequence[float | None]) -> float | None:
    sizes = [abs(error) for error in errors if error is not None]
    return float(np.median(sizes)) if sizes else None
