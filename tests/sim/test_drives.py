"""What the stepper has between a command and a joint: delays, drive, motor, gear, transmission."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hopping_leg.robot import DriveMismatch, Latency, dynamics, load_robot
from tests.sim.legs import (
    POSTURE,
    STEP,
    both,
    hanging,
    make_legs,
    with_joints,
    with_reality,
    with_strong_motors,
    without_friction,
)  # fmt: skip

CAD = load_robot("legv2")


def late(command=0.0, jitter=0.0, measurement=0.0):
    return with_reality(latency=Latency(command, measurement, jitter))


@pytest.mark.parametrize(("steps", "rate"), [(1, 2000), (4, 2000), (7, 2000), (10, 200), (60, 200)])
def test_latency_shifts_the_response_by_the_stated_time(steps, rate):
    legs = hanging(CAD, 2, rate=rate, robots=[CAD, late(steps * STEP)])
    moved = []
    for _ in range(10):
        legs.step(np.array([[3.0, 0.0], [3.0, 0.0]]))
        moved.append(np.abs(legs.qd[:, 0]) > 1e-6)
    first, second = np.argmax(moved, axis=0)
    assert (second - first) * legs.substeps == steps


def test_motion_is_smooth_in_a_latency_of_parts_of_a_step():
    """What a late command did changes with its latency as evenly within steps as across them."""
    smooth = without_friction(CAD)
    latencies = np.linspace(0, 8e-3, 161)
    robots = [with_reality(smooth, latency=Latency(command=late)) for late in latencies]
    legs = hanging(smooth, len(robots), robots=robots)
    for tick in range(8):
        legs.step(np.full((len(robots), 2), 0.4 * np.sin(tick)))
    slopes = np.diff(legs.q, axis=0) / np.abs(np.diff(legs.q, axis=0)).max(0)
    assert np.abs(np.diff(slopes, axis=0)).max() < 0.15
    assert np.ptp(legs.q, axis=0).min() > 1e-4


@given(st.floats(0, 0.02), st.floats(0, 0.01), st.floats(0, 0.01), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_command_overtakes_another_nor_is_one_blended_in_what_is_measured(
    command, jitter, measurement, seed
):
    """Commands count up, so that a falling torque would be a command overtaken."""
    legs = make_legs(CAD, 5, robots=[late(command, jitter)] * 4 + [late(command, 0.0, measurement)])
    legs.rng = np.random.default_rng(seed)
    legs.place(slice(None), 5.0, POSTURE)
    before = np.zeros((5, 2))
    for tick in range(12):
        mean = legs.step(np.full((5, 2), 0.1 * (tick + 1)))
        now = legs.measured_torque
        np.testing.assert_allclose(np.round(now * 10) / 10, now, atol=1e-15)
        assert (before <= now).all()
        assert (before <= mean + 1e-12).all()
        assert (mean <= now + 1e-12)[:4].all()
        oldest = 0.1 * (tick + 1 - (command + jitter) / legs.period)
        assert (now >= oldest - 1e-9)[:4].all()
        before = now.copy()


@pytest.mark.parametrize("voltage", [1.0, 0.5])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_torque_speed_line_holds_at_every_physics_step(voltage, sign):
    robot = with_reality(without_friction(CAD), voltage=voltage)
    legs = make_legs(robot, 1, rate=1 / STEP)
    legs.place(slice(None), 50.0, np.array([0.0, 0.0]))
    legs.qd[0, 1] = -1.2 * sign * CAD.knee.no_load_speed
    braking = legs.step(np.array([[0.0, sign * 50.0]]))[0, 1]
    assert braking == sign * CAD.knee.torque_limit, "the software alone limits it"
    legs.place(slice(None), 50.0, np.array([0.0, -2.0 * sign]))
    stall = CAD.knee.motor.peak_torque * CAD.knee.belt_ratio
    fastest = 0.0
    for _ in range(150):
        share = sign * legs.qd[0, 1] / CAD.knee.no_load_speed
        line = stall * max(voltage - share, 0.0)
        given = legs.step(np.array([[0.0, sign * 1e3]]))[0, 1]
        assert given == pytest.approx(sign * min(line, CAD.knee.torque_limit), abs=1e-12)
        fastest = max(fastest, abs(legs.qd[0, 1]))
        assert legs.records["loads"][0, 6] == pytest.approx(abs(legs.qd[0, 1]))
        if abs(legs.q[0, 1]) > 2.5:
            break
    assert 0.6 * voltage < fastest / CAD.knee.no_load_speed < 1.05 * voltage


def test_gain_lag_and_limits_shape_the_motor_torque():
    drive = DriveMismatch(torque_gain=0.9, torque_lag=0.01, torque_limit=4.0)
    legs = hanging(with_reality(hip=drive, knee=DriveMismatch(torque_limit=8.0)))
    seen = []
    for _ in range(20):
        legs.step(np.array([[3.0, 0.0]]))
        seen.append(legs.measured_torque[0, 0])
    time = 0.005 * np.arange(1, 21)
    np.testing.assert_allclose(seen, 2.7 * (1 - np.exp(-time / 0.01)), rtol=1e-9)
    given = [legs.step(np.full((1, 2), 50.0))[0] for _ in range(4)]
    assert given[0][1] == 8.0
    assert given[0][0] < given[1][0] <= 4.0


@pytest.mark.parametrize("damping", [0.2, 3.0])
def test_a_drives_own_pd_is_the_continuous_one(damping):
    """Against the equations of motion, integrated finely; a strong damping stays stable."""
    robot = with_strong_motors(without_friction(CAD))
    stiffness, position = [15.0, 15.0], [0.5, -1.0]
    command = np.array([[0.0, 0.0, *stiffness, *position, damping, damping, 0.3, 0.3]])
    errors = []
    for step in (STEP, STEP / 4):
        legs = hanging(robot, timestep=step, q=(0.2, -0.4))
        legs.command[:] = command
        for _ in range(30):
            legs.step(command[:, :2])
        errors.append(np.abs(legs.q[0] - continuous(robot, command[0], 0.15)[:2]).max())
    assert errors[0] < 1e-3
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.05)


def continuous(robot, command, duration):
    """Integrate a fixed leg under PD; return its angles and speeds."""

    def rate(_, y):
        q, qd = y[:2], y[2:]
        torque = command[2:4] * (command[4:6] - q) + command[6:8] * (command[8:10] - qd)
        mass, bias = dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, qd)
        return np.concatenate([qd, np.linalg.solve(mass[1:, 1:], torque - bias[1:])])

    start = np.array([0.2, -0.4, 0.0, 0.0])
    return solve_ivp(rate, (0, duration), start, rtol=1e-10, atol=1e-12).y[:, -1]


def gained(torque, q=(0.0, 0.0), qd=(0.0, 0.0), **drive):
    """Return what a physics step of a torque adds to the knees' speed, beside gravity, (64,)."""
    robot = with_strong_motors(without_friction(CAD))
    speeds = []
    for effects, asked in ((drive, torque), ({}, 0.0)):
        legs = hanging(with_reality(robot, knee=DriveMismatch(**effects)), 64, q=q, rate=1 / STEP)
        legs.qd[:] = qd
        given = legs.step(np.full((64, 2), [0.0, asked]))
        np.testing.assert_array_equal(
            [given, legs.measured_torque], np.full((2, 64, 2), [0, asked])
        )
        speeds.append(legs.qd[:, 1].copy())
    return speeds[0] - speeds[1]


@pytest.mark.parametrize("torque", [-1.0, 1.0])
@pytest.mark.parametrize(("sign", "share"), [(1.0, 0.8), (-1.0, 1 / 0.8)])
def test_a_gear_takes_from_driving_and_adds_to_braking(torque, sign, share):
    speed = 5 * sign * torque
    lossy, ideal = (gained(torque, qd=(0.0, speed), efficiency=e) for e in (0.8, 1.0))
    np.testing.assert_allclose(lossy / ideal, share, rtol=1e-2)


def test_cogging_repeats_with_the_motor_angle_and_has_its_amplitude():
    angles = np.linspace(0, 2 * np.pi / 8, 64, endpoint=False)
    q = np.stack([np.zeros(64), angles], axis=1)
    share = gained(0.0, q, ripple=0.1, ripple_periods=8.0) / gained(0.1, q)
    np.testing.assert_allclose(share, np.sin(8 * angles), atol=1e-9)


def test_stiction_holds_up_to_its_share_of_friction():
    robot = with_joints(CAD, friction=0.4, damping=0.0)
    robots = [with_reality(robot, **both(stiction=share)) for share in (1.0, 1.5, 1.5)]
    legs = hanging(CAD, 3, robots=robots)
    for _ in range(20):
        legs.step(np.array([[0.55, 0.0], [0.55, 0.0], [0.65, 0.0]]))
    assert (np.abs(legs.q[:, 0]) > [0.02, 1e-4, 0.02]).tolist() == [True, False, True]
