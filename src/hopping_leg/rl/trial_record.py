"""What a search has found, as plain values: every trial, the best, what mattered."""

from typing import Any

from optuna.importance import get_param_importances
from optuna.study import Study
from optuna.trial import FrozenTrial, TrialState

from hopping_leg.io import versions

FOLDER, ERROR = "folder", "error"
"""Attributes of a trial: number of the trial whose folder it goes on in; why it failed."""


def record(study: Study) -> dict[str, Any]:
    """Return all trials, the best, and each number's importance, as JSON values."""
    trials = study.get_trials(deepcopy=False)
    done = [t for t in trials if t.state is TrialState.COMPLETE]
    best = min(done, key=lambda t: float(t.value or 0.0)) if done else None
    return {
        "trials": [_row(trial) for trial in trials],
        "best": None if best is None else _row(best),
        "importance": _importance(study, done),
        "versions": versions("hopping-leg", "optuna", "torch", "mujoco"),
    }


def _importance(study: Study, done: list[FrozenTrial]) -> dict[str, float]:
    """Return how much each number matters (PED-ANOVA), empty where too few trials tell."""
    if len(done) < 4 or len({trial.value for trial in done}) < 2:
        return {}
    return {name: float(share) for name, share in get_param_importances(study).items()}


def _row(trial: FrozenTrial) -> dict[str, Any]:
    began, ended = trial.datetime_start, trial.datetime_complete or None
    return {
        "number": trial.number,
        "state": trial.state.name.lower(),
        "score_m": trial.value if trial.state is TrialState.COMPLETE else None,
        "snapshots_m": [trial.intermediate_values[k] for k in sorted(trial.intermediate_values)],
        "params": trial.params,
        "minutes": (ended - began).total_seconds() / 60 if began and ended else None,
        "goes_on_from": trial.user_attrs.get(FOLDER),
        "error": trial.user_attrs.get(ERROR),
    }
