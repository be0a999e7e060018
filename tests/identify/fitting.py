"""A small identification of a leg that is known exactly, run once for all tests."""

import functools

from hopping_leg.identify.optimizers import SearchOptions
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from tests.identify.twin import LEG, record, swing

TRUTH = {"hip.friction": 0.12, "knee.damping": 0.06}
TWIN = LegHypothesis(LEG).replace(TRUTH).robot
EFFORT = SearchOptions(rounds=2, evaluations=3, generations=4, population=4)
RATE = 100.0


@functools.cache
def run(phase=0.0):
    """Return a recording of the twin, 6 s."""
    return record(TWIN, swing(6.0, rate=RATE, phase=phase), rate=RATE, name=f"swing {phase}")


def options(**changes):
    """Return options that take a moment."""
    return IdentifyOptions(**{"parameters": tuple(TRUTH), "effort": EFFORT, **changes})


@functools.cache
def identified():
    """Return what least squares makes of the twin's recording."""
    return identify([run()], LEG, options=options())
