"""MPC on a particle filter: a leg is known, and hops, by its joints and own commands alone."""

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.mpc import FilterOptions, Mpc, ParticleFilter
from hopping_leg.controllers.registry import load_controller
from hopping_leg.io import replace_at
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.sim import CONTROL_RATE, NO_NOISE, LegSimulator, Measurement
from tests.controllers.measurements import hops_of, measurement

ROBOT = load_robot("legv2")
HEIGHTS = np.array([0.22, 0.28, 0.34, 0.40])
STEP = 5e-4
SETTLED = 1.5


def hop(controller, commands, seconds=5.0, seed=0, legs=None, **setup):
    config = RolloutConfig(ROBOT, timestep=STEP, threads=1, **setup)
    wanted = np.tile(commands, (round(seconds * config.rate), 1))
    return rollout(controller, config, wanted, seed, legs=legs)


def errors_of(run, commands):
    """Return the errors of apexes after the first ones, m, for each leg."""
    found = []
    for leg, command in enumerate(commands):
        hops = hops_of(run, leg)
        found.append(hops.apex[run.time[hops.tick] > SETTLED] - command)
        assert len(found[-1]) >= 5
    return found


@pytest.fixture(scope="module")
def noisy():
    return hop(load_controller("mpc", ROBOT), HEIGHTS)


@pytest.fixture(scope="module")
def clean():
    return hop(load_controller("mpc", ROBOT), HEIGHTS, disturbance=NO_NOISE)


@pytest.mark.parametrize(("run", "most"), [("noisy", 0.006), ("clean", 0.004)])
def test_it_hops_as_high_as_asked(run, most, request):
    for errors in errors_of(request.getfixturevalue(run), HEIGHTS):
        assert abs(np.median(errors)) < most
        assert np.abs(errors).mean() < 1.5 * most


def test_estimates_are_those_of_the_leg(noisy, clean):
    for run, most in ((noisy, 0.006), (clean, 0.004)):
        error = (run.data["estimated_height_m"] - run.data["height_m"])[run.time > SETTLED]
        assert np.sqrt((error**2).mean()) < most
        for leg in range(len(HEIGHTS)):
            ends = [tick for tick in hops_of(run, leg).tick if run.time[tick] > SETTLED][:-1]
            late = np.array(ends) + 25  # when the next push has begun, the flight is understood
            apex = run.data["height_m"][ends, leg]
            known = run.data["estimated_apex_m"][late, leg]
            assert np.abs(np.median(known - apex)) < 1.5 * most


def test_a_soft_ground_is_felt():
    """Four times as slow, which nobody tells."""
    soft = replace_at(ROBOT, "contact.time_constant", 4 * ROBOT.contact.time_constant)
    legs = LegSimulator(ROBOT, 2, timestep=STEP, threads=1, robots=[ROBOT, soft])
    controller = Mpc(ROBOT)
    run = hop(controller, [0.28, 0.28], 4.0, disturbance=NO_NOISE, legs=legs)
    time = controller.estimate.parameters[:, 2]
    assert abs(time[0]) < 0.3
    assert time[1] > 0.6
    assert np.abs(np.median(errors_of(run, [0.28, 0.28])[1])) < 0.01


def test_the_same_seed_gives_the_same_torques_whatever_the_number_of_legs():
    one = hop(Mpc(ROBOT), [0.3], 1.0, disturbance=NO_NOISE)
    two = hop(Mpc(ROBOT), [0.3, 0.24], 1.0, disturbance=NO_NOISE)
    for name in ("hip_command_nm", "knee_command_nm", "estimated_height_m"):
        np.testing.assert_array_equal(one.data[name][:, 0], two.data[name][:, 0])


def test_track_that_is_lost_is_found_again():
    """A hand lifts the hopping leg, holds it and puts it down; afterwards it hops as asked."""
    legs = LegSimulator(ROBOT, 1, timestep=STEP, threads=1)
    controller = Mpc(ROBOT)

    class Lifted:
        name = "lifted"

        def reset(self, count):
            controller.reset(count)
            self.tick = 0

        def act(self, seen):
            self.tick += 1
            if 300 < self.tick <= 400:
                legs.height[:], legs.height_rate[:] = 0.5, 0.0
            return controller.act(seen)

        def internals(self):
            return controller.internals()

    run = hop(Lifted(), [0.3], 6.0, disturbance=NO_NOISE, legs=legs)
    assert controller.estimate.losses[0] > 0
    hops = hops_of(run, 0)
    after = hops.apex[run.time[hops.tick] > 3.5] - 0.3
    assert len(after) >= 4
    assert np.abs(np.median(after)) < 0.01


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e9, -50.0])
def test_torques_are_finite_whatever_is_measured(value):
    controller = Mpc(ROBOT)
    controller.reset(2)
    sound = Measurement(
        np.tile([0.8, -1.6], (2, 3, 1)), np.zeros((2, 3, 2)), np.full((2, 3), 0.3),
        np.tile([0.0, 0.005, 0.01], (2, 1)),
    )  # fmt: skip
    broken = Measurement(sound.q.copy(), sound.qd.copy(), sound.command, sound.age)
    broken.q[0, 0], broken.qd[0, 1] = value, value
    for tick in range(60):
        torque = controller.act(broken if tick in (0, 20, 21, 22) else sound)
        assert np.isfinite(torque).all()
        assert (np.abs(torque) <= ROBOT.of_joints("torque_limit") + 1e-9).all()
    controller.reset(3)
    assert np.isfinite(controller.act(measurement(3))).all()


def test_a_standing_leg_is_where_its_kinematics_say():
    known = ParticleFilter(ROBOT, 1 / CONTROL_RATE, FilterOptions(particles=100))
    known.reset(1)
    q = np.tile([0.8, -1.6], (1, 3, 1))
    known.update(Measurement(q, 0 * q, np.full((1, 3), 0.3), np.array([[0.0, 0.005, 0.01]])))
    stand = kinematics.stance_height(ROBOT, q[0, 0])
    np.testing.assert_allclose(known.state[0, 0], stand, atol=0.004)
