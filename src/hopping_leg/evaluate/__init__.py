"""Trials, hop metrics, statistics, figures and the report."""

from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.runner import Entry, EvaluationRun, evaluate

__all__ = ["Entry", "Evaluation", "EvaluationRun", "evaluate"]
