"""Without a robot's name, a controller hops on the one that it was trained on."""

import dataclasses

import pytest

from hopping_leg.controllers.registry import load_policy, robot_of, shipped_policies
from hopping_leg.rl.onnx_export import with_card
from hopping_leg.robot import DEFAULT_ROBOT, load_robot, shipped_robots

OTHER = next(name for name in shipped_robots() if name.startswith("leg") and name != DEFAULT_ROBOT)


@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_fits_the_shipped_robot_that_it_was_trained_on(name):
    robot = robot_of([name])
    assert robot in shipped_robots()
    assert not load_policy(name).stranger(load_robot(robot), name)


def test_the_first_policy_decides(tmp_path):
    policy = load_policy("paper")

    def made_on(robot):
        card, path = dataclasses.replace(policy.card, robot=robot), tmp_path / f"{robot}.onnx"
        path.write_bytes(with_card(policy.content, card))
        return str(path)

    first, second = made_on(OTHER), made_on(DEFAULT_ROBOT)
    assert robot_of([first]) == robot_of(["energy-shaping", first, second]) == OTHER
    assert robot_of([second, first]) == DEFAULT_ROBOT
    assert robot_of([made_on("my-leg")]) == DEFAULT_ROBOT, "it is not shipped"


def test_who_was_not_trained_hops_on_the_default_robot():
    for controllers in ([], ["energy-shaping"], ["universal"], ["missing.onnx", "my.toml"]):
        assert robot_of(controllers) == DEFAULT_ROBOT
