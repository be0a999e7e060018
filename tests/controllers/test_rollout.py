import math

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule, check_heights, command_range
from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import Perturbation
from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.io import replace_at
from hopping_leg.robot import command_limits, load_robot
from hopping_leg.sim import NO_NOISE
from tests.sim.legs import POSTURE, make_legs, with_joints

ROBOT, LEG = load_robot("legv2"), load_robot("legv2-paper")


class Constant:
    """Asks for the same torques at every tick."""

    name = "constant"

    def __init__(self, torque):
        self.torque = np.array(torque, dtype=float)

    def reset(self, count):
        self.count = count

    def act(self, measurement):
        return np.tile(self.torque, (self.count, 1))

    def internals(self):
        return {"tick_torque_nm": np.full(self.count, self.torque[1])}


def test_a_rollout_records_states_before_and_torques_during_each_tick():
    setup = RolloutConfig(ROBOT, NO_NOISE, threads=1)
    run = rollout(Constant([0.5, -1.0]), setup, np.full((50, 3), 0.3), seed=0)
    np.testing.assert_allclose(run.data["hip_position_rad"][0], setup.start_posture[0])
    np.testing.assert_array_equal(run.data["knee_command_nm"], -1.0)
    np.testing.assert_array_equal(run.data["tick_torque_nm"], -1.0)
    assert run.time[1] == pytest.approx(0.005)
    trace = run.trace(1, trial="x")
    assert trace.header["trial"] == "x"
    assert len(trace.table) == 50


@pytest.mark.parametrize("length", [0.03, 0.15, 0.5])
def test_legs_of_any_size_start_standing(length):
    robot = ROBOT
    for path, value in (("length", length), ("com", length / 3)):
        robot = replace_at(replace_at(robot, f"shank.{path}", value), f"thigh.{path}", value)
    setup = RolloutConfig(robot, NO_NOISE, threads=1)
    run = rollout(Constant([0, 0]), setup, np.full((2, 1), 0.3), seed=0)
    assert run.data["foot_clearance_m"][0, 0] == pytest.approx(0, abs=1e-9)
    assert np.isfinite(run.data["height_m"]).all()


@pytest.mark.parametrize(
    ("field", "value"), [("rate", 0.0), ("rate", np.nan), ("timestep", -1.0), ("threads", -1)]
)
def test_meaningless_setups_are_refused(field, value):
    with pytest.raises(UsageError, match=field):
        RolloutConfig(ROBOT, **{field: value})


def test_an_unstable_simulation_is_an_error():
    robot = with_joints(ROBOT, armature=1e-12, friction=0.0, damping=0.0)
    robot = replace_at(replace_at(robot, "shank.mass", 1e-6), "shank.inertia", 1e-12)
    with pytest.raises(PhysicsError, match="unstable"):
        rollout(Constant([5, -20]), RolloutConfig(robot, threads=1), np.full((100, 2), 0.3), seed=0)


def test_a_schedule_steps_and_stays():
    schedule = CommandSchedule.parse("0.25:5,0.30:2.5")
    assert [schedule.at(t) for t in (0, 4.99, 5, 100)] == [0.25, 0.25, 0.30, 0.30]
    assert schedule.seconds == 7.5


@pytest.mark.parametrize("text", ["", "0.3", "0.3:0", "a:b", "nan:1", "0.3:inf"])
def test_what_is_no_schedule_is_refused(text):
    with pytest.raises(UsageError, match="no step of a schedule"):
        CommandSchedule.parse(text)


def test_a_policy_is_asked_for_what_it_was_trained_for_and_others_for_what_the_leg_reaches():
    policy = load_controller("fast", LEG)
    low, high = command_range(policy, LEG)
    assert (low, high) == (policy.card.command_low, policy.card.command_high)
    check_heights([low, high], (low, high), "fast")
    for height in (low - 0.01, high + 0.01, math.nan):
        with pytest.raises(UsageError, match="'fast' cannot be asked"):
            check_heights([height], (low, high), "fast")
    assert command_range(load_controller("energy-shaping", LEG), LEG) == command_limits(LEG)


@pytest.mark.parametrize("rise", [0.03, -0.03])
def test_pushes_act_and_ground_steps_shift_floor_and_clearance_once_the_foot_is_clear(rise):
    legs = make_legs(ROBOT, 2)
    legs.stand(slice(None), POSTURE, np.array([0.05, 0.0]))
    height, clearance = legs.height.copy(), legs.foot_clearance()
    rows, ground = np.ones((2, 2)), np.zeros(2)
    plan = Perturbation((ROBOT, ROBOT), np.zeros((2, 2, 2)), 20.0 * rows, rise * rows)
    for tick in range(2):
        ground = plan.act(legs, ground, tick)
        np.testing.assert_allclose(ground, [rise, 0.0])
        np.testing.assert_allclose(legs.height, height - ground)
        np.testing.assert_allclose(legs.foot_clearance(), clearance - ground, atol=1e-12)
    np.testing.assert_array_equal(legs.memory()["push"], 20.0)
