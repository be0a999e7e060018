"""How trials of the benchmark went: shares of successes, and how sure they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.evaluate import metrics, statistics
from hopping_leg.evaluate.robustness.trials import AxisTrials

TOLERANCE = 0.02
"""Largest magnitude of the median apex minus the command in a successful trial, m."""


@dataclass(frozen=True)
class Outcome:
    """What is kept of a trial."""

    level: float
    """Level of the axis."""
    command_m: float
    """Desired apex height."""
    repeat: int
    """Number of the realisation."""
    error_m: float | None
    """Median apex minus command; where the command steps, of the height that is missed most; None
    without a hop."""
    skipped: int
    """Hops that should have happened and did not."""
    contacts: int
    """Times base or knee touched the ground."""

    @property
    def success(self) -> bool:
        """Whether no hop was skipped and the median apex is as commanded."""
        return self.skipped == 0 and self.error_m is not None and abs(self.error_m) <= TOLERANCE


def run_axis(
    controller: Controller,
    setup: RolloutConfig,
    plan: AxisTrials,
    on_tick: Callable[[int, int], None] | None = None,
) -> list[Outcome]:
    """Let a controller that knows ``setup`` alone meet all trials of an axis."""
    run = rollout(
        controller, setup, plan.commands, plan.seed, on_tick, perturbation=plan.perturbation
    )
    outcomes = []
    for leg, trial in enumerate(plan.trials):
        windows = metrics.measure(run.trace(leg))
        outcomes.append(
            Outcome(
                trial.level,
                trial.command,
                trial.repeat,
                _worst_error(windows),
                sum(w.skipped for w in windows),
                sum(w.body_contacts for w in windows),
            )
        )
    return outcomes


def _worst_error(windows: list[metrics.HopWindow]) -> float | None:
    """Return the median error of the command that is missed most; None if one has no hop."""
    errors = []
    for command in {w.command for w in windows}:
        apex = metrics.pooled_apexes([w for w in windows if w.command == command])
        if not len(apex):
            return None
        errors.append(float(np.median(apex)) - command)
    return max(errors, key=abs)


OVERALL = "overall"
"""Row of the mean over all axes."""


def share(axes: Sequence[Sequence[Array]], seed: int) -> tuple[float, float, float]:
    """Return the mean over axes of the mean over levels of the share of successes.

    Its 95 % bootstrap interval follows, in which trials (1 for a success, 0 else) are resampled
    within their level; NaN where a level has one trial alone.
    """
    levels = [level for axis in axes for level in axis]
    weights = np.array([1 / len(axis) for axis in axes for _ in axis]) / len(axes)

    def statistic(*samples: Array, axis: int) -> Array:
        return weights @ np.stack([sample.mean(axis=axis) for sample in samples])  # type: ignore[no-any-return]

    score = float(weights @ [level.mean() for level in levels])
    if any(len(level) < 2 for level in levels):
        return score, float("nan"), float("nan")
    return score, *statistics.bootstrap(levels, statistic, seed, vectorized=True)


def by_level(outcomes: Sequence[Outcome]) -> dict[float, list[Outcome]]:
    """Return the trials of every level, by rising level."""
    return {
        level: [one for one in outcomes if one.level == level]
        for level in sorted({one.level for one in outcomes})
    }


def level_rows(controller: str, axis: str, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the results of each level of an axis, by rising level."""
    rows = []
    for level, group in by_level(outcomes).items():
        sizes = [abs(one.error_m) for one in group if one.error_m is not None]
        rows.append(
            {
                "controller": controller,
                "axis": axis,
                "level": level,
                "success": float(np.mean([one.success for one in group])),
                "median_abs_error_m": float(np.median(sizes)) if sizes else None,
                "skipped_hops": sum(one.skipped for one in group),
                "body_contacts": sum(one.contacts for one in group),
                "trials": len(group),
            }
        )
    return rows


def score_rows(
    controller: str, outcomes: dict[str, list[Outcome]], seed: int
) -> list[dict[str, Any]]:
    """Return a controller's score on every axis, given its trials by axis, and overall."""
    levels = {
        axis: [
            np.array([one.success for one in group], float) for group in by_level(found).values()
        ]
        for axis, found in outcomes.items()
    }
    rows = []
    for axis, groups in {
        **{a: [own] for a, own in levels.items()},
        OVERALL: [*levels.values()],
    }.items():
        score, low, high = share(groups, seed)
        trials = sum(len(level) for group in groups for level in group)
        row = {"controller": controller, "axis": axis, "score": score, "low": low, "high": high}
        rows.append({**row, "trials": trials})
    return rows
