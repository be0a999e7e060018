import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.safety_limits import hopping_limits, recording_limits
from hopping_leg.robot import JOINTS, load_robot
from hopping_leg.sim import NO_NOISE

LEG = load_robot("legv2-paper")


@pytest.mark.parametrize("name", ["fast", "energy-shaping"])
def test_who_hops_as_trained_is_not_stopped_for_it(name):
    limits = hopping_limits(LEG, 200.0)
    commands = np.tile([0.25, 0.30, 0.35], (800, 1))
    run = rollout(
        load_controller(name, LEG), RolloutConfig(LEG, NO_NOISE, threads=1), commands, seed=0
    )
    sides = zip(JOINTS, limits.lower, limits.upper, limits.braking, strict=True)
    for joint, lower, upper, braking in sides:
        angle, speed = (run.data[f"{joint}_{what}"] for what in ("position_rad", "velocity_rad_s"))
        ahead = angle + braking * speed
        assert lower < min(angle.min(), ahead.min())
        assert max(angle.max(), ahead.max()) < upper


def test_no_leg_may_go_where_its_mechanism_ends():
    limits, recording = hopping_limits(LEG, 200.0), recording_limits(LEG, 200.0)
    stops = [(joint.stop_lower, joint.stop_upper) for joint in (LEG.hip, LEG.knee)]
    assert list(zip(limits.lower, limits.upper, strict=True)) == stops
    for index in range(2):
        assert recording.lower[index] < limits.lower[index]
        assert limits.upper[index] < recording.upper[index]
    assert recording.braking == (0.0, 0.0)
    for joint, (low, high), stop in zip((LEG.hip, LEG.knee), limits.start, stops, strict=True):
        assert stop[0] <= low < joint.lower < joint.upper < high <= stop[1]
