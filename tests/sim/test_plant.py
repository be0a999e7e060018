import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.errors import UsageError
from hopping_leg.robot import SoftLimits, dynamics, load_robot
from hopping_leg.sim import Channel, LegSimulator, NoiseAndDelay, Plant, SoftLimiter
from tests.sim.legs import with_joints

ROBOT = load_robot("legv2")
OUTSIDE = np.array([1.5, -2.5])
COUNT = 64


def plant(soft_limits, disturbance):
    """Return legs in the air, hip and knee beyond their soft limits and turning."""
    legs = LegSimulator(ROBOT, COUNT, threads=1)
    made = Plant(legs, disturbance, soft_limits, np.random.default_rng(0))
    legs.place(slice(None), 5.0, OUTSIDE)
    made.channel.restart(slice(None), legs.q, legs.qd, np.zeros(COUNT))
    legs.qd[:] = np.random.default_rng(1).normal(0, 5, (COUNT, 2))
    return made


@pytest.mark.parametrize("replace", [False, True])
def test_soft_limits_act_on_the_sample_that_the_controllers_saw(replace):
    soft = SoftLimits(replace=replace)
    made, limiter = plant(soft, NoiseAndDelay()), SoftLimiter(ROBOT, soft)
    for _ in range(20):
        seen = made.sense(np.zeros(COUNT))
        torque = np.full((COUNT, 2), 0.5)
        made.drive(torque)
        expected = limiter.added(torque, np.concatenate([seen.q, seen.qd], axis=2))
        np.testing.assert_array_equal(made.soft_limit_torque, expected)
    assert (seen.age[:, 0] > 0).any()
    assert (made.soft_limit_torque != 0).any()


def test_what_soft_limits_add_is_noisy_and_limited_with_the_rest():
    noise = NoiseAndDelay(joint_noise=0.0, torque_noise=0.15, delay_probability=0.0)
    torque = np.full((COUNT, 2), -9.0)
    made, by_hand = plant(SoftLimits(stiffness=100.0), noise), plant(None, noise)
    for one in (made, by_hand):
        one.sense(np.zeros(COUNT))
    given = made.drive(torque)
    np.testing.assert_array_equal(by_hand.drive(torque + made.soft_limit_torque), given)
    assert (np.abs(made.soft_limit_torque) > 1).all()
    assert (np.abs(given) <= ROBOT.of_joints("torque_limit")).all()


finite = st.floats(-100, 100)
pairs = st.tuples(finite, finite).map(np.array)


def added(soft, torque, q, qd, robot=ROBOT):
    """Return what soft limits add to the torque of one leg at a sample, (2,) each."""
    return SoftLimiter(robot, soft).added(torque[None], np.concatenate([q, qd])[None, None])[0]


@given(st.floats(0, 1), st.floats(0, 1), pairs, pairs)
def test_soft_limits_leave_torques_inside_the_limits_alone(hip, knee, torque, qd):
    lower, upper = ROBOT.of_joints("lower"), ROBOT.of_joints("upper")
    q = lower + np.array([hip, knee]) * (upper - lower)
    np.testing.assert_array_equal(added(SoftLimits(), torque, q, qd), 0)


@pytest.mark.parametrize(("side", "sign"), [("lower", 1), ("upper", -1)])
@pytest.mark.parametrize("replace", [False, True])
def test_soft_limits_pull_back_inside(side, sign, replace):
    q = ROBOT.of_joints(side) - sign * 0.1
    soft = SoftLimits(stiffness=20.0, damping=0.0, replace=replace)
    pull = added(soft, np.ones(2), q, np.zeros(2))
    np.testing.assert_allclose(pull, sign * 2.0 - replace)


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["legv1", "legv2", "legv2-paper"])
def test_soft_limits_do_not_ring_on_a_late_sample(name, joint, late):
    robot, period = load_robot(name), 0.005
    bounded = with_joints(robot, lower=0.0, upper=0.0)  # outside on both sides
    mobility = np.linalg.inv(dynamics.mass_matrix(robot, np.array([0.5, -1.2])))
    damping = (robot.hip, robot.knee)[joint].damping
    q, qd, samples = 0.1, 0.0, [(0.1, 0.0)] * (late + 1)
    for _ in range(100):
        seen = (np.eye(2)[joint] * value for value in samples[-1 - late])
        torque = added(SoftLimits(), np.zeros(2), *seen, robot=bounded)[joint]
        for _ in range(50):
            qd += period / 50 * (torque - damping * qd) * mobility[joint + 1, joint + 1]
            q += period / 50 * qd
        samples.append((q, qd))
    angle = np.array(samples)[:, 0]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(angle)))) + 1
    swings = np.abs(angle[turns])
    swings = swings[swings > 1e-3]
    assert (swings[1:] < 0.57 * swings[:-1]).all()  # what a damping ratio of 0.18 leaves
    assert abs(angle[-1]) < 5e-3


PERIOD = 0.005
QUIET = NoiseAndDelay(joint_noise=0.0, torque_noise=0.0)


def channel(count, disturbance, seed=0):
    return Channel(count, disturbance, PERIOD, np.random.default_rng(seed))


def seen_by(one, q, qd, command):
    """Return what a channel shows of a true state."""
    return one.measurement(one.samples(q, qd, command))


def at(tick, count):
    """A true state and command that spell the tick."""
    value = float(tick)
    return np.full((count, 2), value), np.full((count, 2), -value), np.full(count, value)


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(3, 10))
def test_delayed_samples_stay_in_order_and_carry_their_age(seed, count, depth):
    delayed = channel(count, dataclasses.replace(QUIET, delay_buffer=depth), seed)
    delayed.restart(slice(None), *at(0, count))
    for tick in range(1, 40):
        seen = seen_by(delayed, *at(tick, count))
        np.testing.assert_array_equal(delayed.actuate(seen.q[:, 0]), seen.q[:, 0])
        ages = np.round(seen.age / PERIOD).astype(int)
        assert (np.diff(ages, axis=1) > 0).all()
        assert ages.min() >= 0
        assert ages.max() < depth
        stamps = np.maximum(tick - ages, 0)
        np.testing.assert_array_equal(seen.q, np.repeat(stamps[..., None], 2, axis=2))
        np.testing.assert_array_equal(seen.qd, -seen.q)
        np.testing.assert_array_equal(seen.command, stamps)


def test_noise_fills_its_share_of_the_value_evenly():
    noise = NoiseAndDelay(delay_probability=0.0)
    noisy = channel(2000, noise)
    q, qd, asked = np.random.default_rng(1).normal(0, 5, (3, 2000, 2))
    seen = seen_by(noisy, q, qd, np.full(2000, 0.3))
    shares = {"joint_noise": (seen.q[:, 0] / q - 1, seen.qd[:, 0] / qd - 1)}
    shares["torque_noise"] = (noisy.actuate(asked) / asked - 1,)
    for name, found in shares.items():
        for share in np.array(found) / getattr(noise, name):
            assert np.abs(share).max() <= 1 + 1e-9
            assert share.mean() == pytest.approx(0.0, abs=0.05)
            assert share.std() == pytest.approx(1 / np.sqrt(3), abs=0.02)
    assert (seen.command[:, 0] == 0.3).all()


def passed(one, ticks):
    """Return what a channel shows and gives in some ticks."""
    seen = [(seen_by(one, *at(t, 2)).q, one.actuate(np.ones((2, 2)))) for t in ticks]
    return [np.stack(values) for values in zip(*seen, strict=True)]


def test_a_restarted_leg_has_no_past():
    noisy = channel(2, QUIET)
    passed(noisy, range(25))
    noisy.restart(np.array([1]), *at(100, 1))
    seen = seen_by(noisy, *at(100, 2))
    assert (seen.q[1] == 100).all()
    assert (seen.q[0, 1:] < 100).all()


@pytest.mark.parametrize("ticks", [3, 511, 512, 700])
def test_a_restored_channel_goes_on_exactly(ticks):
    one, other = channel(2, NoiseAndDelay(), 1), channel(2, NoiseAndDelay(), 2)
    passed(one, range(ticks))
    other.restore(one.state())
    rest = range(ticks, ticks + 600)
    for ours, theirs in zip(passed(one, rest), passed(other, rest), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("joint_noise", -0.1),
        ("torque_noise", np.nan),
        ("delay_probability", 2),
        ("delay_buffer", 2),
    ],
)
def test_a_meaningless_disturbance_is_refused(field, value):
    with pytest.raises(UsageError, match=field):
        NoiseAndDelay(**{field: value})
