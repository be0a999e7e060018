import dataclasses
import itertools

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.fallback import Fallback, with_fallback
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller, load_policy
from hopping_leg.controllers.rollout import rollout
from hopping_leg.errors import UsageError
from hopping_leg.rl.onnx_export import with_card
from hopping_leg.robot import load_robot
from tests.controllers.measurements import hops_of, steady

FAST = load_policy("fast")
ROBOT = load_robot(FAST.card.robot)
LOW, HIGH = (0.0, -2.0, -10.0, -20.0), (1.0, -0.5, 10.0, 20.0)
INSIDE = steady((0.5, -1.2), (0.0, 0.0))


def fallback(policy):
    chain, said = Fallback(policy, load_controller("energy-shaping", ROBOT)), []
    chain.report = said.append
    return chain, said


@pytest.mark.parametrize(
    ("joint", "value", "named"),
    [
        ("q", (1.3, -1.2), "hip position 1.3"),
        ("q", (0.5, 0.2), "knee position 0.2"),
        ("qd", (-16.0, 0.0), "hip velocity -16"),
    ],
)
def test_inputs_that_stay_beyond_the_training_hand_over_for_good(joint, value, named):
    card = dataclasses.replace(FAST.card, input_low=LOW, input_high=HIGH)
    chain, said = fallback(Policy(with_card(FAST.content, card), "ranged", "ranged"))
    beyond = dataclasses.replace(INSIDE, **{joint: np.tile(value, (1, 3, 1))})
    for seen in (beyond, beyond, INSIDE, beyond, beyond):
        chain.act(seen)
    assert not said
    chain.act(beyond)
    assert len(said) == 1
    assert named in said[0]
    chain.act(INSIDE)
    assert chain.internals()["fallback"] == [1.0]
    chain.reset(1)
    assert chain.internals()["fallback"] == [0.0]


def test_energy_shaping_hops_on_where_a_policy_fails():
    """The policy fails after three seconds, in whatever phase the leg is then."""
    policy, ticks = load_policy("fast"), 1600
    acts = itertools.chain([policy.act] * 600, [lambda _: np.full((1, 2), np.nan)])
    policy.act = lambda seen: next(acts)(seen)
    chain, said = fallback(policy)
    run = rollout(chain, RolloutConfig(ROBOT), np.full((ticks, 1), 0.30), 1000)
    hops = hops_of(run, 0)
    apexes = hops.apex[hops.tick > 800]
    assert len(said) == 1
    assert run.data["fallback"][[599, 600], 0].tolist() == [0.0, 1.0]
    assert len(apexes) >= 5
    assert np.abs(np.median(apexes) - 0.30) < 0.03


def test_a_policy_that_raises_hands_over_by_its_sentence():
    policy = load_policy("fast")
    chain, said = fallback(policy)
    policy.act = lambda _: (_ for _ in ()).throw(UsageError("It gave up."))
    assert np.isfinite(chain.act(INSIDE)).all()
    assert said == ["energy-shaping took over from fast: It gave up."]


def test_nothing_takes_over_from_other_controllers_or_where_the_robot_names_nothing():
    shaping = load_controller("energy-shaping", ROBOT)
    assert with_fallback(shaping, ROBOT) is shaping
    hardware = dataclasses.replace(ROBOT.hardware, fallback="")
    assert with_fallback(FAST, dataclasses.replace(ROBOT, hardware=hardware)) is FAST
    assert isinstance(with_fallback(FAST, ROBOT), Fallback)
