"""A training is done once; a policy is judged by the command, whatever it was trained for."""

import json

import numpy as np
import pytest
from tests.controllers.test_rollout import Constant

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.registry import load_policy
from hopping_leg.robot import load_robot
from hopping_leg.sim import Measurement
from studies.sim_to_real.policies import WithinRange, hop


def test_a_leg_that_never_hops_errs_by_the_distance_from_standing():
    (row,) = hop(Constant([0.0, 0.0]), load_robot("legv2-paper"), (0.3,), 1)
    standing = RolloutConfig(load_robot("legv2-paper")).standing_length + 0.01
    assert row["motionless"]
    assert row["median_error_m"] == pytest.approx(standing - 0.3, abs=1e-3)
    assert row["median_abs_error_m"] == -row["median_error_m"]
    assert json.dumps(row)


def test_a_policy_is_asked_for_the_nearest_height_of_its_training():
    policy, asked = load_policy("fast"), []
    act = policy.act
    policy.act = lambda seen: asked.append(seen.command) or act(seen)
    within = WithinRange(policy, load_robot("legv2"))
    within.reset(2)
    zeros, command = np.zeros((2, 3, 2)), np.array([[0.3] * 3, [9.0] * 3])
    within.act(Measurement(zeros, zeros, command, np.zeros((2, 3))))
    np.testing.assert_array_equal(asked[0][:, 0], [0.3, policy.card.command_high])
