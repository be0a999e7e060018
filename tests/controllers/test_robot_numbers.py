"""A robot in numbers without units."""

import math
import operator

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers import robot_numbers
from hopping_leg.io import replace_at
from hopping_leg.robot import load_robot

LEG = load_robot("legv2-identified")


MOMENT, INERTIA = ("heavier", "longer"), ("heavier", "longer", "longer")
UNITS = {
    "base.mass": ("heavier",), "foot.radius": ("longer",),
    "rail.friction": ("heavier",), "rail.damping": ("heavier", "rate"),
    **{f"{link}.{name}": factors for link in ("thigh", "shank") for name, factors in (
        ("length", ("longer",)), ("com", ("longer",)), ("mass", ("heavier",)),
        ("inertia", INERTIA))},
    **{f"{joint}.{name}": factors for joint in ("hip", "knee") for name, factors in (
        ("motor.torque_limit", MOMENT), ("motor.peak_torque", MOMENT),
        ("motor.no_load_speed", ("rate",)), ("friction", MOMENT),
        ("damping", (*MOMENT, "time")), ("armature", INERTIA))},
}  # fmt: skip
"""Of what the numbers of a leg are made."""


def grown(longer, heavier):
    """Return a leg of the same shape: of other length and mass, under the same gravity."""
    time, robot = np.sqrt(longer), LEG
    units = {"longer": longer, "heavier": heavier, "time": time, "rate": 1 / time}
    for path, factors in UNITS.items():
        number = operator.attrgetter(path)(LEG)
        robot = replace_at(robot, path, number * math.prod(units[name] for name in factors))
    return robot


@given(longer=st.floats(0.8, 1.25), heavier=st.floats(0.6, 1.7))
def test_legs_of_one_shape_differ_in_length_and_mass_alone(longer, heavier):
    leg = grown(longer, heavier)
    one, other = (robot_numbers.robot_numbers(robot) for robot in (LEG, leg))
    assert set(np.flatnonzero(np.abs(one - other) > 1e-9).tolist()) <= {0, 2}
    full = robot_numbers.full_torque(leg) / robot_numbers.full_torque(LEG)
    np.testing.assert_allclose(full, longer * heavier)
