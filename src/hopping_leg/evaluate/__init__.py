"""Trials, hop metrics, statistics, figures and the report."""

from hopping_leg.evaluate.runner import Entry, EvaluationRun, evaluate

__all__ = ["Entry", "EvaluationRun", "evaluate"]
