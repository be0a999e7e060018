import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping import equations, tuned_energy_shaping
from hopping_leg.controllers.energy_shaping.virtual_leg import Phase
from hopping_leg.evaluate.metrics import measure
from hopping_leg.robot import GRAVITY, load_robot
from hopping_leg.sim import NO_NOISE

ROBOT = load_robot("legv2-paper")
QUIET = RolloutConfig(ROBOT, NO_NOISE, threads=1)
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
        assert abs(np.median(window.apex - window.command)) < 0.008
        assert np.std(window.apex) < 0.010
        assert window.contacts("base") == window.contacts("knee") == 0


def test_phases_follow_each_other_in_order(tuned):
    phase = tuned.data["phase"]
    change = np.diff(phase, axis=0) % 3
    assert set(np.unique(phase)) == {Phase.LIFTOFF, Phase.FLIGHT, Phase.TOUCHDOWN}
    assert set(np.unique(change)) == {0, 1}


def test_reset_forgets_everything_and_legs_do_not_depend_on_their_neighbours():
    controller = tuned_energy_shaping(ROBOT)
    first, again = (hop(controller, QUIET, seconds=1.0).data["height_m"] for _ in range(2))
    np.testing.assert_array_equal(first, again)
    alone = hop(controller, QUIET, commands=(0.35,), seconds=1.0)
    np.testing.assert_allclose(first[:, 2], alone.data["height_m"][:, 0])


@pytest.mark.parametrize(
    ("robot", "command", "rate"),
    [
        ("legv2", 0.3, 200.0),
        pytest.param("legv2-paper", 0.3, 400.0, marks=pytest.mark.slow),
        pytest.param("legv1", 0.42, 200.0, marks=pytest.mark.slow),
    ],
)
def test_gains_carry_over_to_other_legs_and_rates(robot, command, rate):
    leg = load_robot(robot)
    setup = RolloutConfig(leg, rate=rate, threads=1)
    window = measure(hop(tuned_energy_shaping(leg, rate=rate), setup, (command,)).trace(0))[0]
    assert len(window.apex) >= 4
    assert abs(np.median(window.apex - window.command)) < 0.02
    assert window.contacts("base") == window.contacts("knee") == 0


def test_feedforward_force_does_the_work_of_the_climb_and_is_bounded_for_an_extended_leg():
    command, start, end = np.array([0.3, 0.35]), np.array([0.15, 0.26]), np.full(2, 0.25)
    force, extended = equations.feedforward_force(ROBOT, command, start, end)
    climb = 0.3 - 0.15 - ROBOT.foot.radius
    assert force * (0.25 - 0.15) == pytest.approx(ROBOT.mass * GRAVITY * climb)
    assert 0 < extended < 200


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_gain_rests_at_the_desired_height_and_moves_towards_it_by_bounded_steps(exponent):
    reached, absurd = np.array([0.27, 0.30, 0.33]), np.array([0.0, -1.0, 1.2])
    gain = equations.updated_gain(np.ones(3), np.full(3, 0.3), reached, exponent)
    np.testing.assert_allclose(gain, (0.30 / reached) ** exponent)
    assert gain[1] == 1
    gain = equations.updated_gain(np.ones(3), np.full(3, 0.3), absurd, exponent)
    least, most = np.array(equations.STEP) ** exponent
    assert ((least <= gain) & (gain <= most)).all()
