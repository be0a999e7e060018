"""How trials of the benchmark went: shares of successes, and how sure they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.evaluate.metrics import HopWindow, measure, pooled_apexes
from hopping_leg.evaluate.robustness.trials import AxisTrials, RobustnessTrial
from hopping_leg.evaluate.statistics import bootstrap
from hopping_leg.trace import Trace

TOLERANCE = 0.02
"""Largest magnitude of the median apex minus the command in a successful trial, m."""


@dataclass(frozen=True)
class Outcome:
    """What is kept of a trial.

    Attributes:
        level: Level of the axis.
        command_m: Desired apex height.
        repeat: Number of the realisation.
        error_m: Median apex minus command; where the command steps, of the height that is missed
            most; None without a hop.
        skipped: Hops that should have happened and did not.
        contacts: Times base or knee touched the ground.
    """

    level: float
    command_m: float
    repeat: int
    error_m: float | None
    skipped: int
    contacts: int

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
    """Let a controller meet all trials of an axis.

    Args:
        controller: Knows ``setup`` alone.
        setup: What it believes, with the paper's noise and delay.
        plan: What it meets.
        on_tick: Called with (ticks done, ticks in all).
    """
    run = rollout(
        controller, setup, plan.commands, plan.seed, on_tick, perturbation=plan.perturbation
    )
    return [judge(trial, run.trace(leg)) for leg, trial in enumerate(plan.trials)]


def judge(trial: RobustnessTrial, trace: Trace) -> Outcome:
    """Measure one trial."""
    windows = measure(trace)
    return Outcome(
        trial.level,
        trial.command,
        trial.repeat,
        _worst([_median_error(windows, command) for command in {w.command for w in windows}]),
        sum(w.skipped for w in windows),
        sum(w.body_contacts for w in windows),
    )


def _median_error(windows: list[HopWindow], command: float) -> float | None:
    apex = pooled_apexes([w for w in windows if w.command == command])
    return float(np.median(apex)) - command if len(apex) else None


def _worst(errors: list[float | None]) -> float | None:
    """Return the error of largest magnitude; None if one does not exist."""
    known = [error for error in errors if error is not None]
    return max(known, key=abs) if len(known) == len(errors) else None


OVERALL = "overall"
"""Row of the mean over all axes."""


def share(axes: Sequence[Sequence[Array]], seed: int) -> tuple[float, float, float]:
    """Return the mean over axes of the mean over levels of the share of successes.

    Args:
        axes: Per axis and level: 1 for every successful trial, 0 for the others, (trials,).
        seed: Seed of the bootstrap.

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
    return score, *bootstrap(levels, statistic, seed, vectorized=True)


def by_level(outcomes: Sequence[Outcome]) -> dict[float, list[Outcome]]:
    """Return the trials of every level, by rising level."""
    return {
        level: [one for one in outcomes if one.level == level]
        for level in sorted({one.level for one in outcomes})
    }


def level_rows(controller: str, axis: str, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the results of each level of an axis, by rising level."""
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
        seed: Seed of the bootstrap.
    """
    levels = {
        axis: [
            np.array([one.success for one in group], np.float64)
            for group in by_level(found).values()
        ]
        for axis, found in outcomes.items()
    }
    rows = []
    for axis in (*levels, OVERALL):
        groups = list(levels.values()) if axis == OVERALL else [levels[axis]]
        score, low, high = share(groups, seed)
        trials = sum(len(level) for group in groups for level in group)
        row = {"controller": controller, "axis": axis, "score": score, "low": low, "high": high}
        rows.append({**row, "trials": trials})
    return rows


def _median_size(errors: Sequence[float | None]) -> float | None:
    sizes = [abs(error) for error in errors if error is not None]
    return float(np.median(sizes)) if sizes else None
