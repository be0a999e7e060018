from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping import paper_energy_shaping, tuned_energy_shaping
from hopping_leg.controllers.energy_shaping.phases import Phase
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import measure
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE

ROBOT = load_robot("legv2-paper")
COMMANDS = (0.25, 0.30, 0.35)


def hop(controller, setup, commands=COMMANDS, seconds=5.0, seed=1234):
    rows = np.tile(commands, (round(seconds * setup.rate), 1))
    return rollout(controller, setup, rows, seed)


@pytest.fixture(scope="module")
def tuned():
    return hop(tuned_energy_shaping(ROBOT), RolloutConfig(ROBOT, threads=1), seconds=6.0)


def test_tuned_hops_to_the_command_through_noise_and_delay(tuned):
    for leg in range(len(COMMANDS)):
        window = measure(tuned.trace(leg))[0]
        assert len(window.apex) >= 6
        assert abs(np.median(window.error)) < 0.008
        assert np.std(window.apex) < 0.010
        assert window.base_contacts == window.knee_contacts == 0


def test_phases_follow_each_other_in_order(tuned):
    phase = tuned.data["phase"]
    change = np.diff(phase, axis=0) % 3
    assert set(np.unique(phase)) == {Phase.LIFTOFF, Phase.FLIGHT, Phase.TOUCHDOWN}
    assert set(np.unique(change)) == {0, 1}


def test_flight_phase_is_airborne_at_its_apex(tuned):
    height, phase = tuned.data["height_m"], tuned.data["phase"]
    clearance = tuned.data["foot_clearance_m"]
    late = round(2.0 / 0.005)
    for leg in range(len(COMMANDS)):
        top = late + np.argmax(height[late:, leg])
        assert phase[top, leg] == Phase.FLIGHT
        assert clearance[top, leg] > 0.003


def test_estimated_apex_is_the_true_one(tuned):
    for leg, command in enumerate(COMMANDS):
        estimate = tuned.data["estimated_apex_m"][400:, leg]
        assert abs(np.median(estimate) - command) < 0.008


def test_legs_do_not_depend_on_their_neighbours():
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    together = hop(tuned_energy_shaping(ROBOT), setup, seconds=2.0)
    alone = hop(tuned_energy_shaping(ROBOT), setup, commands=(0.35,), seconds=2.0)
    np.testing.assert_allclose(together.data["height_m"][:, 2], alone.data["height_m"][:, 0])


def test_reset_forgets_everything():
    setup, controller = RolloutConfig(ROBOT, threads=1), tuned_energy_shaping(ROBOT)
    first = hop(controller, setup, seconds=1.5).data["height_m"]
    np.testing.assert_array_equal(hop(controller, setup, seconds=1.5).data["height_m"], first)


@pytest.mark.slow
def test_gain_rises_on_a_heavier_leg():
    base = replace(ROBOT.base, mass=ROBOT.base.mass + 0.2 * ROBOT.mass)
    heavy = RolloutConfig(replace(ROBOT, base=base), NO_NOISE, threads=1)
    light = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    runs = [hop(tuned_energy_shaping(ROBOT), s, (0.3,), 5.0) for s in (light, heavy)]
    gains = [r.data["gain_k"][-1, 0] for r in runs]
    medians = [np.median(measure(r.trace(0))[0].apex) for r in runs]
    assert gains[1] > 1.05 * gains[0]
    assert abs(medians[1] - medians[0]) < 0.01


def test_literal_law_meets_the_command_when_it_knows_contact_and_height():
    controller = paper_energy_shaping(ROBOT, true_contact=True)
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    run = hop(controller, setup)
    for leg in range(len(COMMANDS)):
        assert abs(np.median(measure(run.trace(leg))[0].error)) < 0.003


@pytest.mark.slow
def test_literal_law_with_its_own_estimate_is_worse_than_the_tuned_one(tuned):
    literal = hop(paper_energy_shaping(ROBOT), RolloutConfig(ROBOT, threads=1), seconds=6.0)

    def spread(rollout):
        return np.mean([np.std(measure(rollout.trace(i))[0].apex) for i in range(3)])

    assert spread(literal) > 1.5 * spread(tuned)


class Blindfolded:
    """Shows a controller what a robot could, and nothing else."""

    name = "blindfolded"

    def __init__(self, controller):
        self.reset, self.act = controller.reset, controller.act
        self.internals = controller.internals


def test_options_that_need_the_truth_say_so():
    with pytest.raises(UsageError, match="simulation only"):
        hop(
            Blindfolded(paper_energy_shaping(ROBOT, true_contact=True)),
            RolloutConfig(ROBOT, NO_NOISE),
        )


@pytest.mark.parametrize(
    ("robot", "command"), [("legv2", 0.3), pytest.param("legv1", 0.42, marks=pytest.mark.slow)]
)
def test_gains_carry_over_to_other_legs(robot, command):
    leg = load_robot(robot)
    setup = RolloutConfig(leg, threads=1, start_length=0.7 * (leg.thigh.length + leg.shank.length))
    window = measure(hop(tuned_energy_shaping(leg), setup, (command,)).trace(0))[0]
    assert len(window.apex) >= 4
    assert abs(np.median(window.error)) < 0.02
    assert window.base_contacts == window.knee_contacts == 0


@pytest.mark.slow
def test_runs_at_400_hz():
    setup = RolloutConfig(ROBOT, rate=400.0, threads=1)
    run = hop(tuned_energy_shaping(ROBOT, rate=400.0), setup, (0.3,))
    assert abs(np.median(measure(run.trace(0))[0].error)) < 0.01
