"""Many legs at once: energy, threads, memory, robots that change, sensors, loads."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.io import replace_at
from hopping_leg.robot import GRAVITY, Boom, DriveMismatch, GroundMismatch, Latency, load_robot
from hopping_leg.robot.model_mismatch import MassScale, SensorMismatch
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.randomization import draw_twin
from tests.sim.legs import (
    POSTURE,
    both,
    energy,
    hanging,
    make_legs,
    states,
    with_reality,
    without_friction,
)  # fmt: skip

CAD = load_robot("legv2")
TWIN = load_robot("twin")
ROBOTS = (
    CAD,
    TWIN,
    draw_twin(3).robot,
    with_reality(latency=Latency(command=0.0043, measurement=0.0012)),
    with_reality(**both(torque_gain=0.8, torque_lag=0.003)),
    with_reality(**both(stiffness=400.0, backlash=0.01, stiction=1.5)),
    with_reality(voltage=0.5, **both(sensor=SensorMismatch(position_step=0.01))),
    dataclasses.replace(CAD, knee=dataclasses.replace(CAD.knee, load_friction=0.1)),
)
"""Legs with every effect, drawn or one at a time."""


def noiseless(robot):
    """Return a robot without what is drawn at random, which depends on who else is there."""
    robot = replace_at(robot, "reality.latency.jitter", 0.0)
    for joint, name in itertools.product(("hip", "knee"), ("position", "velocity", "torque")):
        robot = replace_at(robot, f"reality.{joint}.sensor.{name}_noise", 0.0)
    return robot


def rows(legs):
    sensed = legs.measured_q, legs.measured_qd, legs.measured_torque
    return np.concatenate([legs.state, *sensed, legs.records["loads"]], axis=1)


def shaken(legs, ticks=40, seed=1):
    """Return all that is seen of legs under the same random torques, (ticks, n, 20)."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(ticks):
        legs.step(np.tile(rng.uniform(-6, 6, 2), (legs.count, 1)))
        found.append(rows(legs))
    return np.array(found)


def standing(robots, **options):
    legs = make_legs(CAD, len(robots), robots=robots, **options)
    legs.stand(slice(None), POSTURE, 0.05)
    return legs


@pytest.mark.parametrize(
    "robot", [CAD, with_reality(**both(stiffness=30.0, backlash=0.002))], ids=["rigid", "elastic"]
)
def test_energy_drifts_in_proportion_to_the_step(robot):
    drifts = []
    for timestep in (1e-4, 2.5e-5):
        rng = np.random.default_rng(0)
        legs = make_legs(without_friction(robot), 8, timestep=timestep)
        legs.place(slice(None), 3.0, rng.uniform(-0.8, 0.8, (8, 2)))
        legs.state[:, 3:] = rng.normal(0, 3, (8, 3))
        legs.forget(slice(None))
        np.testing.assert_array_equal([legs.measured_q, legs.measured_qd], [legs.q, legs.qd])
        before, twist = energy(legs), 0.0
        for _ in range(40):
            legs.step(np.zeros((8, 2)))
            twist = max(twist, np.abs(legs.measured_q - legs.q).max())
            assert not legs.records["loads"][:, 7].any()
        drifts.append(np.abs(energy(legs) - before).max())
    assert drifts[0] < 4e-3
    assert drifts[1] == pytest.approx(drifts[0] / 4, rel=0.1)
    assert twist == 0 if robot is CAD else twist > 0.0015


def test_what_became_unstable_stays_so_and_its_neighbour_goes_on():
    alone, legs = standing([CAD]), standing([CAD] * 9)
    legs.qd[0] = 1e12
    for _ in range(20):
        alone.step(np.zeros((1, 2)))
        legs.step(np.zeros((9, 2)))
    assert not np.isfinite(legs.state[0]).all()
    np.testing.assert_array_equal(legs.q[1:], alone.q.repeat(8, axis=0))


def test_same_bytes_at_any_number_of_threads():
    robots = ROBOTS * 250  # enough work for each
    one, *others = (shaken(standing(robots, threads=threads), 12) for threads in (1, 2, 5))
    for other in others:
        np.testing.assert_array_equal(other, one)
    assert np.ptp(one[-1, :, 0]) > 1e-4


def test_every_leg_moves_as_it_does_alone_and_begins_anew_without_a_past():
    boom = dataclasses.replace(CAD, boom=Boom(1.1, 0.3, 0.38))
    robots = [noiseless(robot) for robot in (*ROBOTS[1:], boom, *ROBOTS)]  # more than go at a time
    together = shaken(standing(robots))
    for index, robot in enumerate(robots):
        np.testing.assert_array_equal(together[:, index], shaken(standing([robot]))[:, 0])
    turned = standing(robots[::-1])
    shaken(turned, 7)
    turned.set_robots(robots)
    turned.stand(slice(None), POSTURE, 0.05)
    np.testing.assert_array_equal(shaken(turned), together)


@given(st.integers(0, 12), st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_legs_go_on_exactly_from_a_memory(ticks, seed):
    """Whatever is under way: late and jittered commands, noise, pushes."""
    late = with_reality(TWIN, latency=Latency(command=0.0123, measurement=0.0031, jitter=0.004))
    one, other = standing([*ROBOTS, late]), standing([*ROBOTS, late])
    one.rng = np.random.default_rng(seed)
    one.push(np.arange(one.count, dtype=float))
    shaken(one, ticks)
    memory = one.memory()
    rest = shaken(one, 10, seed=2)
    shaken(other, 7)
    other.restore(memory)
    np.testing.assert_array_equal(shaken(other, 10, seed=2), rest)


def test_sensors_that_become_late_begin_in_the_present_and_commands_under_way_stay():
    legs, past = standing([CAD], rate=2000), []
    legs.set_robots([with_reality(latency=Latency(measurement=4.25 * 5e-4))])
    np.testing.assert_array_equal(legs.measured_q, legs.q)
    for _ in range(8):
        past.append(legs.q.copy())
        legs.step(np.array([[2.0, -1.0]]))
    np.testing.assert_allclose(legs.measured_q, 0.75 * past[-4] + 0.25 * past[-5], atol=1e-12)
    legs = standing([CAD])
    legs.step(np.full((1, 2), 2.0))
    legs.set_robots([with_reality(latency=Latency(command=0.005))])
    np.testing.assert_allclose(legs.step(np.full((1, 2), -3.0)), 2.0)
    np.testing.assert_allclose(legs.step(np.zeros((1, 2))), -3.0)
    with pytest.raises(UsageError, match="at most 7"):
        legs.set_robots([with_reality(latency=Latency(command=0.03, jitter=0.006))])


def test_readings_have_the_stated_noise_and_steps_and_leave_the_physics_alone():
    noise = {"position_noise": 2e-3, "velocity_noise": 0.1, "torque_noise": 0.05}
    steps = {"position_step": 3e-4, "velocity_step": 0.02, "torque_step": 0.01}
    legs = make_legs(with_reality(hip=DriveMismatch(sensor=SensorMismatch(**steps, **noise))), 2000)
    legs.place(slice(None), 5.0, POSTURE)
    legs.step(np.ones((2000, 2)))
    assert np.ptp(legs.state, axis=0).max() == 0.0
    readings = (legs.measured_q, legs.measured_qd, legs.measured_torque)
    for reading, step, deviation in zip(readings, steps.values(), noise.values(), strict=True):
        assert reading.std(axis=0) == pytest.approx([deviation, 0], rel=0.05, abs=1e-12)
        ticks = reading[:, 0] / step
        np.testing.assert_allclose(ticks, np.round(ticks), atol=1e-9)


def test_true_masses_and_ground_are_those_of_a_robot_that_has_them():
    ground = {"time_constant": 0.05, "friction": 0.3}
    deceived = with_reality(mass=MassScale(base=1.1, thigh=1.2), ground=GroundMismatch(**ground))
    thigh, scaled = CAD.thigh, {"mass": 1.2 * CAD.thigh.mass, "inertia": 1.2 * CAD.thigh.inertia}
    changed = dataclasses.replace(
        replace_at(CAD, "base.mass", 1.1 * CAD.base.mass),
        thigh=dataclasses.replace(thigh, **scaled),
        contact=dataclasses.replace(CAD.contact, **ground),
    )
    one, other = (states(make_legs(robot, 1)) for robot in (deceived, changed))
    np.testing.assert_allclose(one, other, atol=1e-9)
    assert np.abs(one - states(make_legs(CAD, 1))).max() > 1e-3


@pytest.mark.parametrize("robot", [CAD, noiseless(ROBOTS[5])], ids=["rigid", "elastic"])
def test_loads_are_means_extremes_and_contacts_of_the_steps(robot):
    fine, coarse = standing([robot], rate=2000), standing([robot])
    for tick in range(60):
        torque = np.array([[1.0, 4.0]]) * np.cos(tick)
        coarse.step(torque)
        steps = []
        for _ in range(10):
            given_torque = fine.step(torque)[0]
            steps.append([*given_torque**2, *(given_torque * fine.measured_qd[0])])
            steps[-1] += [sum(steps[-1][2:]), *np.abs(fine.qd[0]), *fine.records["loads"][0, 7:]]
        steps = np.array(steps)
        expected = [*steps[:, :4].mean(0), steps[:, 4].min(), *steps[:, 5:].max(0)]
        np.testing.assert_allclose(coarse.records["loads"][0], expected, rtol=1e-9, atol=1e-12)


def test_the_ground_bears_nothing_in_the_air_and_the_weight_at_rest():
    rubbing, forces = replace_at(CAD, "rail.friction", 2.0), []
    legs, weight = standing([rubbing]), CAD.mass * GRAVITY
    for _ in range(600):
        legs.step(np.zeros((1, 2)))
        forces.append(legs.records["loads"][0, 8] / weight)
    assert forces[0] == pytest.approx(0, abs=1e-9), "what the rail bears is not the ground's"
    assert max(forces) > 2
    assert forces[-1] == pytest.approx(1, abs=2.0 / weight)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stop_is_reported(joint, sign):
    legs = hanging(CAD, 2, rate=2000)
    stop = CAD.of_joints("stop_upper" if sign > 0 else "stop_lower")[joint]
    legs.q[:, joint] = stop + sign * np.array([-0.01, 0.01])
    legs.step(np.zeros((2, 2)))
    assert legs.records["loads"][:, 7].tolist() == [0, 1]


def test_what_cannot_be_is_refused():
    with pytest.raises(UsageError, match="3 robots were given for 2 legs"):
        LegSimulator(CAD, 2, robots=[CAD] * 3)
    for timestep in (3e-3, 0.0, -1e-3, float("nan")):
        with pytest.raises(UsageError, match="physics step"):
            LegSimulator(CAD, 1, timestep=timestep)
    with pytest.raises(RobotError, match=r"reality.knee.stiffness.*a smaller step"):
        make_legs(with_reality(knee=DriveMismatch(stiffness=1e6)))
    with pytest.raises(RobotError, match=r"reality.hip' has a backlash .* 'stiffness'"):
        make_legs(with_reality(hip=DriveMismatch(backlash=0.01)))
