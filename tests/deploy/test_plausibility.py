"""What drives say: healthy ones are believed, whatever their sensors; each lie is told apart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.deploy.drive_link import DriveMode, Reply
from hopping_leg.deploy.plausibility import JointEvidence, LagEvidence
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.robot import load_robot

PERIOD = 0.005
MOTOR = hopping_limits(load_robot("legv2"), 200.0).motors[0]


def replies(angle, noise=0.0, velocity=None, torque=lambda t: 0.0):
    """Return replies of a joint at an angle of time, rad, its rate unless told otherwise."""
    rng = np.random.default_rng(0)
    rate = velocity or (lambda t: (angle(t + 1e-6) - angle(t - 1e-6)) / 2e-6)
    return [
        Reply(
            angle(t) + noise * rng.normal(), rate(t) + 500 * noise * rng.normal(), torque(t),
            DriveMode.POSITION, 0, 24.0, 30.0, t,
        )
        for t in np.arange(100) * PERIOD
    ]  # fmt: skip


def evidence(said, told=lambda t: 0.0):
    """Return the evidence after replies to torques told in the ticks before."""
    known, last = JointEvidence(), None
    for reply in said:
        known, last = known.after(MOTOR, last, reply, told(reply.taken - PERIOD)), reply
    return known


def swing(t):
    return 0.5 * math.sin(15 * t)


def until(angle, moment):
    return lambda t: angle(min(t, moment))


@pytest.mark.parametrize("noise", [0.0, 1.4e-4])
def test_a_joint_that_swings_is_believed_and_one_whose_encoder_died_is_not(noise):
    healthy = evidence(replies(swing, noise))
    assert healthy.dead(MOTOR) == healthy.false_velocity() == healthy.false_torque() == ""
    said = replies(swing, noise)
    died = [*said[:80], *(r for r in replies(lambda _: said[79].position, 0.0, lambda _: 0.0)[80:])]
    assert evidence(died[:84]).dead(MOTOR)


def test_a_joint_that_rests_is_believed_until_its_torque_changes_or_it_had_noise():
    rest = replies(lambda _: 0.3)
    assert evidence(rest, lambda _: 3.0).dead(MOTOR) == ""
    assert "torque changed" in evidence(rest, lambda t: 3.0 if t > 0.4 else 0.0).dead(MOTOR)
    noisy = replies(lambda _: 0.3, 1e-4)
    assert evidence(noisy).dead(MOTOR) == ""
    assert "no readings repeated" in evidence([*noisy[:80], *rest[80:]]).dead(MOTOR)


def test_an_encoder_that_dies_when_it_is_powered_is_told_by_the_noise_before():
    noisy, rest = replies(lambda _: 0.3, 1e-4), replies(lambda _: 0.3)
    unpowered = [replace(reply, mode=DriveMode.STOPPED) for reply in noisy[:10]]
    assert evidence([*unpowered, *rest[10:17]]).dead(MOTOR)
    held = [replace(reply, mode=DriveMode.STOPPED) for reply in rest[:10]]
    assert evidence([*held, *noisy[10:30], *rest[30:]]).dead(MOTOR) == ""


@pytest.mark.parametrize("factor", [0.5, 2.0, -1.0])
def test_a_velocity_that_is_another_is_told(factor):
    said = replies(swing, 1e-4, lambda t: factor * 7.5 * math.cos(15 * t))
    assert evidence(said[:12]).false_velocity()


@pytest.mark.parametrize(("factor", "false"), [(1, False), (0.44, False), (0, True), (-1, True)])
def test_a_torque_that_is_another_is_told(factor, false):
    told = lambda t: 3.0 * math.sin(40 * t)  # noqa: E731
    said = replies(swing, 1e-4, torque=lambda t: factor * told(t - PERIOD))
    assert bool(evidence(said, told).false_torque()) == false


def test_the_torque_of_a_joint_that_is_shaken_tells_nothing():
    wave = lambda t: (1.0, 1.0, -1.0, -1.0)[round(t / PERIOD) % 4]  # noqa: E731
    said = replies(swing, velocity=lambda t: 20 * wave(t), torque=lambda t: 2 * wave(t - PERIOD))
    assert evidence(said, lambda t: 8 * wave(t - PERIOD)).false_torque() == ""


@pytest.mark.parametrize("lost", [0, 2, 3])
@pytest.mark.parametrize(("before", "after", "stale"), [(1, 1, False), (1, 2, True), (3, 3, True)])
def test_torques_that_come_later_than_before_make_samples_old(before, after, stale, lost):
    told = lambda t: 3.0 * round(math.sin(40 * t))  # noqa: E731
    known, unknown = LagEvidence(), LagEvidence().usual
    for tick in range(200):
        t, lag = tick * PERIOD, before if tick < 100 else after
        reply = Reply(0.0, 0.0, told(t - lag * PERIOD), DriveMode.POSITION, 0, 24.0, 30.0, t)
        pair = told(t - PERIOD), told(t - PERIOD)
        said = None if tick > 90 and lost and tick % lost == 0 else reply
        known = known.after((MOTOR, MOTOR), (reply, said), pair)
        assert tick >= 10 or known.usual == unknown  # a few changes fit any lag by chance
    assert bool(known.stale()) == stale
    after_a_gap = LagEvidence(usual=known.usual)
    for _ in range(3):
        after_a_gap = after_a_gap.after((MOTOR, MOTOR), (reply, reply), pair)
        assert after_a_gap.usual == known.usual
