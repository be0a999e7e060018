"""A robot in numbers without units."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers import robot_numbers
from hopping_leg.robot import Robot, load_robot

LEG = load_robot("legv2-identified")


def grown(robot: Robot, longer: float, heavier: float) -> Robot:
    """Return a leg of the same shape: of other length and mass, under the same gravity."""
    time = np.sqrt(longer)
    moment, inertia = heavier * longer, heavier * longer**2

    def link(old):
        return replace(
            old, length=old.length * longer, com=old.com * longer, mass=old.mass * heavier,
            inertia=old.inertia * inertia,
        )  # fmt: skip

    def joint(old):
        motor = replace(
            old.motor, torque_limit=old.motor.torque_limit * moment,
            peak_torque=old.motor.peak_torque * moment,
            no_load_speed=old.motor.no_load_speed / time,
        )  # fmt: skip
        return replace(
            old, motor=motor, friction=old.friction * moment, damping=old.damping * moment * time,
            armature=old.armature * inertia,
        )  # fmt: skip

    rail = replace(
        robot.rail, friction=robot.rail.friction * heavier,
        damping=robot.rail.damping * heavier / time,
    )  # fmt: skip
    return replace(
        robot, thigh=link(robot.thigh), shank=link(robot.shank), hip=joint(robot.hip),
        knee=joint(robot.knee), rail=rail, base=replace(robot.base, mass=robot.base.mass * heavier),
        foot=replace(robot.foot, radius=robot.foot.radius * longer),
    )  # fmt: skip


@given(longer=st.floats(0.8, 1.25), heavier=st.floats(0.6, 1.7))
def test_legs_of_one_shape_differ_in_length_and_mass_alone(longer, heavier):
    one, other = (
        robot_numbers.robot_numbers(robot) for robot in (LEG, grown(LEG, longer, heavier))
    )
    different = np.flatnonzero(np.abs(one - other) > 1e-9).tolist()
    assert set(different) <= {0, 2}
    full = robot_numbers.full_torque(grown(LEG, longer, heavier)) / robot_numbers.full_torque(LEG)
    np.testing.assert_allclose(full, longer * heavier)
