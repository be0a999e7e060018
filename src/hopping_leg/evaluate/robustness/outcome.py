"""How trials of the benchmark went: shares of successes, and how sure they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

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
    error_m: float
    """Median apex minus command; where the command steps, of the height that is missed most."""
    missed: bool
    """Whether there was no hop at a height, whose error is standing height minus command."""
    skipped: int
    """Hops that should have happened and did not."""
    contacts: int
    """Times base or knee touched the ground."""

    @property
    def success(self) -> bool:
        """Whether no hop was skipped and the median apex is as commanded."""
        return self.skipped == 0 and not self.missed and abs(self.error_m) <= TOLERANCE


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
                *_worst_error(windows),
                sum(w.skipped for w in windows),
                sum(w.body_contacts for w in windows),
            )
        )
    return outcomes


def _worst_error(windows: list[metrics.HopWindow]) -> tuple[float, bool]:
    """Return the median error of the command that is missed most, and if one was without a hop."""
    groups = [[w for w in windows if w.command == c] for c in {w.command for w in windows}]
    errors = [float(np.median(np.concatenate(metrics.errors_of(group)))) for group in groups]
    missed = any(not sum(len(w.apex) for w in group) for group in groups)
    return max(errors, key=abs), missed


OVERALL = "overall"
"""Row of the mean over all axes."""


def share(axes: Sequence[Sequence[Outcome]], seed: int) -> tuple[float, float, float]:
    """Return the mean over axes of the mean over levels of the share of successes.

    Its 95 % interval follows, over realisations: all levels, commands and axes share their draws,
    so that a realisation is one unit.
    """
    repeats = sorted({one.repeat for axis in axes for one in axis})
    scores = np.array(
        [
            np.mean([_mean_of_levels([one for one in axis if one.repeat == r]) for axis in axes])
            for r in repeats
        ]
    )
    return float(scores.mean()), *statistics.share_interval(scores, seed)


def _mean_of_levels(outcomes: Sequence[Outcome]) -> float:
    levels = by_level(outcomes).values()
    return float(np.mean([np.mean([one.success for one in level]) for level in levels]))


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
        rows.append(
            {
                "controller": controller,
                "axis": axis,
                "level": level,
                "success": float(np.mean([one.success for one in group])),
                "median_abs_error_m": float(np.median([abs(one.error_m) for one in group])),
                "missed": sum(one.missed for one in group),
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
    rows = []
    for axis, groups in {
        **{a: [own] for a, own in outcomes.items()},
        OVERALL: [*outcomes.values()],
    }.items():
        score, low, high = share(groups, seed)
        trials = sum(map(len, groups))
        row = {"controller": controller, "axis": axis, "score": score, "low": low, "high": high}
        rows.append({**row, "trials": trials})
    return rows
