"""How a trial of the benchmark went."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.evaluate.metrics import Window, measure, pooled_apexes
from hopping_leg.evaluate.robustness.plan import Plan, Trial
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


def run_plan(
    controller: Controller,
    setup: RolloutConfig,
    plan: Plan,
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


def judge(trial: Trial, trace: Trace) -> Outcome:
    """Measure one trial."""
    windows = measure(trace)
    return Outcome(
        trial.level,
        trial.command,
        trial.repeat,
        _worst([_median_error(windows, command) for command in {w.command for w in windows}]),
        sum(w.skipped for w in windows),
        sum(w.base_contacts + w.knee_contacts for w in windows),
    )


def _median_error(windows: list[Window], command: float) -> float | None:
    apex = pooled_apexes([w for w in windows if w.command == command])
    return float(np.median(apex)) - command if len(apex) else None


def _worst(errors: list[float | None]) -> float | None:
    """Return the error of largest magnitude; None if one does not exist."""
    known = [error for error in errors if error is not None]
    return max(known, key=abs) if len(known) == len(errors) else None
