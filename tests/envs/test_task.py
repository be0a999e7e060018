from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers import robot_numbers
from hopping_leg.envs import HoppingTask, Reward, TaskConfig, paper_reward
from hopping_leg.envs.apex_reward import ballistic_apex
from hopping_leg.envs.observation import sample_scaling
from hopping_leg.errors import UsageError
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import NO_NOISE
from hopping_leg.sim.any_leg import draw_any_leg
from hopping_leg.sim.randomization import WIDE_RANGES

ROBOT = load_robot("legv2-paper")
BUSY = TaskConfig(episode=0.2, reset_distribution="mixed", random_episode_start=True)
BUSY = replace(BUSY, command_resampling_time=(0.05, 0.1))


def task(options=BUSY, count=6, seed=0):
    rng = np.random.default_rng(seed)
    return HoppingTask(ROBOT, count, options, paper_reward(ROBOT), rng, 1)


def actions(ticks, count=6, seed=7):
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (ticks, count, 2))


def fingerprint(step):
    parts = [step.observation, step.reward, step.truncated, step.apex_error, step.height]
    return [part.tobytes() for part in (*parts, step.terms)]


@pytest.mark.parametrize(("differ", "ticks"), [(False, 1), (False, 37), (False, 90), (True, 30)])
def test_a_restored_task_goes_on_exactly(differ, ticks):
    options = replace(BUSY, randomised=WIDE_RANGES)
    make = (lambda seed: mixed()) if differ else (lambda seed: task(options, seed=seed))
    one, other = make(0), make(5)
    plan = actions(ticks + 60, one.count)
    for action in plan[:ticks]:
        last = one.step(action)
    state = one.state()
    told = [fingerprint(one.step(action)) for action in plan[ticks:]]
    np.testing.assert_array_equal(other.restore(state), last.observation)
    assert [fingerprint(other.step(action)) for action in plan[ticks:]] == told


def test_observations_are_newest_first_and_normalised():
    options = TaskConfig(disturbance=NO_NOISE)
    quiet = task(options, count=2)
    scaling = sample_scaling(ROBOT, options)
    offset, gain = scaling.offset, scaling.gain
    truth = []
    for action in actions(5, count=2):
        observation = quiet.step(action).observation
        legs = quiet.legs
        truth.insert(0, np.hstack([legs.q, legs.qd, quiet.command[:, None]]))
    expected = np.hstack([(sample - offset) * gain for sample in truth[:3]])
    np.testing.assert_allclose(observation, expected, rtol=1e-5, atol=1e-6)
    lower = np.hstack([ROBOT.of_joints("lower"), [0, 0, 0.25]])
    np.testing.assert_allclose(((lower - offset) * gain)[[0, 1, 4]], -1.0)
    upper = np.hstack([ROBOT.of_joints("upper"), [10, 10, 0.35]])
    np.testing.assert_allclose((upper - offset) * gain, 1.0)


def test_a_critic_sees_the_apex_in_sight_the_last_action_and_the_time_since_an_apex():
    hopper = task(TaskConfig(action_torque=(10, 20), disturbance=NO_NOISE), count=3)
    since, apexes = np.zeros(3), 0
    for action in actions(200, 3):
        step, legs = hopper.step(action), hopper.legs
        excess = ballistic_apex(legs.height, legs.height_rate) - hopper.command
        since = np.where(np.isnan(step.apex_error), since + 1 / 200, 0.0)
        apexes += np.count_nonzero(since == 0)
        seen = [np.clip(excess / 0.05, -3, 3), np.exp(-np.abs(excess) / 0.02)]
        seen = np.stack([*seen, np.sign(legs.height_rate), *action.clip(-1, 1).T, since], axis=1)
        np.testing.assert_allclose(hopper.privileged()[:, 10:], seen, rtol=1e-5, atol=1e-6)
    assert apexes > 3


def test_commands_come_from_the_paper_or_a_range_and_switch_on_time():
    paper = task(TaskConfig(), count=200)
    assert set(paper.command) == {0.25, 0.30, 0.35}
    often = {"command_resampling_time": (0.05, 0.05), "episode": 10}
    options = TaskConfig(command_range=(0.22, 0.40), **often)
    ranged = task(options, count=200)
    assert len(set(ranged.command)) == 200
    changes = []
    for _ in range(30):
        before = ranged.command.copy()
        ranged.step(np.zeros((200, 2)))
        changes.append((ranged.command != before).mean())
        assert ranged.command.min() >= 0.22
        assert ranged.command.max() <= 0.40
    assert [i + 1 for i, share in enumerate(changes) if share == 1] == [10, 20, 30]


def test_drops_begin_above_the_ground_within_the_limits():
    dropped = task(TaskConfig(reset_distribution="drop"), count=300)
    clearance = dropped.legs.foot_clearance()
    assert clearance.min() >= -1e-12
    assert clearance.max() <= 0.1
    assert np.ptp(clearance) > 0.08
    assert (dropped.legs.q >= ROBOT.of_joints("lower")).all()
    assert (dropped.legs.q <= ROBOT.of_joints("upper")).all()


def test_apexes_are_those_of_the_recorded_heights():
    hopper = task(TaskConfig(action_torque=(10, 20), disturbance=NO_NOISE), count=1)
    postures = joint_angles(ROBOT, np.array([[0.15, 0.0], [0.26, 0.0]]))
    rows, apexes = [], []
    for tick in range(400):
        target = postures[tick // 50 % 2]
        seen = hopper.measurement
        torque = 60 * (target - seen.q[:, 0]) - 1.0 * seen.qd[:, 0]
        step = hopper.step(torque / [10, 20])
        legs = hopper.legs
        rows.append((legs.height[0], legs.height_rate[0], legs.foot_clearance()[0]))
        if not np.isnan(step.apex_height[0]):
            apexes.append(step.apex_height[0])
            assert step.apex_error[0] == pytest.approx(apexes[-1] - hopper.command[0])
    found = find_hops(*np.array(rows).T)
    assert len(found.apex) >= 3
    assert set(found.apex) <= set(apexes), "the highest of each flight"


def test_a_fall_ends_the_episode_and_costs_its_penalty_once_if_asked():
    asked = TaskConfig(disturbance=NO_NOISE, fall_clearance=0.05)
    options = (replace(asked, fall_clearance=None), asked, replace(asked, fall_penalty=7.0))
    never, free, dear = (task(one, count=1) for one in options)
    for _ in range(100):
        alive, a, b = (limp.step(np.zeros((1, 2))) for limp in (never, free, dear))
        assert not alive.terminated[0]
        assert a.reward[0] - b.reward[0] == pytest.approx(7.0 * a.terminated[0])
        if a.terminated[0]:
            return
    pytest.fail("the limp leg's episode never ended")


def test_a_restart_shows_nothing_of_the_last_episode():
    """A leg that begins anew sees as much of its past as one that never did anything."""
    options = TaskConfig(observation="dated", episode=0.1, disturbance=NO_NOISE, commands=(0.3,))
    first = task(options, count=2)
    fresh = first.reset()
    step = [first.step(action) for action in actions(20, count=2)][-1]
    assert step.truncated.all()
    np.testing.assert_array_equal(step.observation, fresh)
    assert not np.allclose(step.final_observation, fresh)


@pytest.mark.parametrize(
    "wrong",
    [
        {"commands": (float("nan"),)},
        {"command_range": (0.4, 0.2)},
        {"reset_distribution": "flying"},
        {"action_torque": (6.0, -1.0)},
    ],
)
def test_options_without_meaning_are_refused(wrong):
    with pytest.raises(UsageError):
        task(TaskConfig(**wrong), count=1)


ANY = TaskConfig(
    observation="any-leg", episode=0.4, episode_grid=4, reset_distribution="hop",
    random_episode_start=True, command_resampling_time=(0.05, 0.1),
)  # fmt: skip


def legs_of_any_size(count=5):
    drawn = enumerate(map(draw_any_leg, range(count)))
    return [replace(leg, command_range=(0.3 + 0.1 * k, 0.35 + 0.1 * k)) for k, leg in drawn]


def mixed(seed=0):
    rng = np.random.default_rng(seed)
    return HoppingTask(ROBOT, 5, ANY, Reward(()), rng, 1, legs=legs_of_any_size())


def test_legs_that_differ_are_asked_and_told_their_own():
    task, ends = mixed(), set()
    low, high = np.array([leg.command_range for leg in task.task_legs]).T
    for action in actions(200, count=5):
        step = task.step(action)
        ends |= {task._tick for _ in np.flatnonzero(step.truncated)}
        assert ((low <= task.command) & (task.command <= high)).all()
    assert ends
    assert {tick % 4 for tick in ends} == {0}
    size = robot_numbers.COUNT
    for row, leg in enumerate(task.task_legs):
        told = robot_numbers.robot_numbers(leg.believed)
        np.testing.assert_allclose(step.observation[row, -size:], told, rtol=1e-6)
        full = robot_numbers.full_torque(leg.believed)
        np.testing.assert_allclose(task.full_torque[row], full)


def test_legs_that_differ_do_not_know_of_each_other_and_start_above_the_ground():
    task = mixed()
    task.reset()
    alone = kinematics.foot_clearance(
        task.task_legs[3].true, task.legs.height[3:4], task.legs.q[3:4]
    )
    assert task.legs.foot_clearance()[3] == pytest.approx(alone[0])
    assert (task.legs.foot_clearance() > -1e-6).all()
