"""Rows of the stepper's table are what a robot file says, or a sentence."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import RobotError
from hopping_leg.robot import DriveMismatch, ModelMismatch, build_model, load_robot, shipped_robots
from hopping_leg.sim.leg_table import leg_table
from tests.sim.legs import with_reality


@pytest.mark.parametrize("name", shipped_robots())
def test_softness_of_constraints_is_mujocos_inverse_weight(name):
    robot = dataclasses.replace(load_robot(name), reality=ModelMismatch())
    (row,), model = leg_table([robot], 5e-4), build_model(robot)
    bodies = [model.body_invweight0[model.body(body).id, 0] for body in ("base", "shank")]
    softness = [row["base_softness"], row["shank_softness"], *row["joint_softness"]]
    np.testing.assert_allclose(softness, [*bodies, *model.dof_invweight0[1:]], rtol=1e-9)


def test_equal_robots_share_a_row_and_order_stays():
    robots = [load_robot("twin"), load_robot("legv2"), load_robot("twin")]
    table = leg_table(robots, 5e-4)
    assert table[0] == table[2] == leg_table(robots[:1], 5e-4)[0]
    assert table[1] == leg_table(robots[1:2], 5e-4)[0]


def test_a_transmission_that_cannot_be_simulated_is_refused():
    with pytest.raises(RobotError, match=r"reality.knee.stiffness.*a smaller step"):
        leg_table([with_reality(knee=DriveMismatch(stiffness=1e6))], 5e-4)
    with pytest.raises(RobotError, match=r"reality.hip' has a backlash .* 'stiffness'"):
        leg_table([with_reality(hip=DriveMismatch(backlash=0.01))], 5e-4)
