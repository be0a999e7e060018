"""Trials, hop metrics, statistics, figures and the report."""

from hopping_leg.evaluate.candidates import Candidate
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.runner import Judged, evaluate

__all__ = ["Candidate", "Evaluation", "Judged", "evaluate"]
