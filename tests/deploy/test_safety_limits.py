import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.safety_limits import hopping_limits, recording_limits
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE

LEG = load_robot("legv2-paper")


@pytest.mark.parametrize(
    "name", ["fast", "precise", "adaptive", "recurrent", "paper", "energy-shaping"]
)
def test_who_hops_as_trained_is_not_stopped_for_it(name):
    limits = hopping_limits(LEG, 200.0)
    commands = np.tile([0.25, 0.30, 0.35], (800, 1))
    run = rollout(
        load_controller(name, LEG), RolloutConfig(LEG, NO_NOISE, threads=1), commands, seed=0
    )
    for joint, lower, upper in zip(("hip", "knee"), limits.lower, limits.upper, strict=True):
        angle = run.data[f"{joint}_position_rad"]
        assert lower < angle.min() < angle.max() < upper


def test_no_leg_may_go_where_its_mechanism_ends():
    limits = hopping_limits(LEG, 200.0)
    stops = [(joint.stop_lower, joint.stop_upper) for joint in (LEG.hip, LEG.knee)]
    for (low, high), lower, upper in zip(stops, limits.lower, limits.upper, strict=True):
        assert low <= lower < upper <= high
    recording = recording_limits(LEG, 200.0)
    for index, joint in enumerate((LEG.hip, LEG.knee)):
        assert recording.lower[index] < limits.lower[index] < joint.lower
        assert joint.upper < limits.upper[index] < recording.upper[index]
