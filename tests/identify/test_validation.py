import numpy as np
import pytest

from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.validation import validate
from tests.identify.twin import LEG, STEP, changed, record, swing

TRUE = LegHypothesis(LEG)
WRONG = TRUE.replace({"hip.friction": 0.4})


def judge(hypothesis, onboard="zoh"):
    run = record(LEG, swing(2.0), onboard=onboard)
    return validate([run], hypothesis, STEP)


@pytest.mark.parametrize("onboard", ["zoh", "torque"])
def test_the_true_robot_predicts_its_own_recording(onboard):
    validation = judge(TRUE, onboard)
    if onboard == "zoh":
        assert max(validation.closed_loop_position) < 1e-4
        assert max(validation.closed_loop_torque) < 1e-3
    assert all(max(pair) < 1e-3 for pair in validation.open_loop_position.values())


def test_a_wrong_robot_errs_the_more_the_longer_it_predicts():
    validation = judge(WRONG)
    assert validation.closed_loop_position[0] > 1e-3
    assert validation.open_loop_position[0.5][0] > validation.open_loop_position[0.2][0] > 1e-3


def test_without_torques_there_is_no_open_loop():
    bare = changed(record(LEG, swing(2.0)), hip_torque_nm=None, knee_torque_nm=None)
    validation = validate([bare], TRUE, STEP)
    assert np.isnan(validation.closed_loop_torque).all()
    assert np.isnan(validation.open_loop_position[0.2]).all()


def test_where_torques_are_commanded_no_loop_is_closed():
    validation = judge(WRONG, "torque")
    assert np.isnan([*validation.closed_loop_position, *validation.closed_loop_torque]).all()
    assert validation.open_loop_position[0.2][0] > 1e-3
    closed, commanded = (record(LEG, swing(2.0), onboard=name) for name in ("zoh", "torque"))
    both = validate([closed, commanded], WRONG, STEP).closed_loop_position
    assert both == validate([closed], WRONG, STEP).closed_loop_position
