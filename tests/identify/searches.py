"""Small problems for the searches: a twin whose parameters are known, and a bowl."""

import numpy as np

from hopping_leg.identify.cost import Objective, Scoring
from hopping_leg.identify.parameters import LegHypothesis, choose
from hopping_leg.identify.simulate import cut
from tests.identify.twin import LEG, record, swing

CAD = LegHypothesis(LEG)
TRUTH = {"hip.friction": 0.12, "hip.damping": 0.05, "knee.friction": 0.08, "knee.damping": 0.02}
RUN = record(CAD.replace(TRUTH).robot, swing(2.0))
SCORING = Scoring(position=0.001, torque=0.05)
TWO = choose(CAD, ["hip.friction", "knee.friction"])
BOTTOM = np.array([1.0, -0.5])


def objective(parameters=TWO, scoring=SCORING, recordings=(RUN,), length=0.5):
    """Return what is searched: residuals over windows of half a second."""
    return Objective(tuple(recordings), tuple(cut(recordings, length)), parameters, scoring)


def bowl(vectors):
    """Return residuals of a tilted bowl with its bottom at (1, -0.5)."""
    return vectors @ np.array([[2.0, 0.3], [0.1, 1.0]]) - np.array([1.95, -0.2])
