import dataclasses

import numpy as np
import pytest
from hopping_leg.sim.mismatch_model import mismatch_model

from hopping_leg.errors import RobotError
from hopping_leg.robot import (
    DriveMismatch,
    GroundMismatch,
    Latency,
    MassScale,
    SensorMismatch,
    load_robot,
)
from hopping_leg.sim import NO_NOISE, MujocoSimulator, NoiseAndDelay, Plant
from tests.sim.legs import POSTURE, with_reality

CAD = load_robot("legv2")
IDLE = DriveMismatch(stiction_speed=1.0)
"""Differs from the neutral drive in a number without effect, so that the effects' code runs."""


def hanging(robot, count=1):
    """Legs with a clamped base, hanging straight down."""
    legs = MujocoSimulator(robot, count, threads=1, clamped=True)
    legs.place(slice(None), 1.0, np.zeros(2))
    return legs


def tracked(robot, ticks=120, seed=0, disturbance=NO_NOISE, threads=1):
    """Return all that happened while a PD shook a standing leg."""
    legs = MujocoSimulator(robot, 3, threads=threads)
    plant = Plant(legs, disturbance, None, np.random.default_rng(seed))
    legs.stand(slice(None), POSTURE, clearance=0.02)
    plant.channel.restart(slice(None), legs.measured_q, legs.measured_qd, np.zeros(3))
    rows = []
    for tick in range(ticks):
        seen = plant.sense(np.zeros(3))
        target = POSTURE + 0.2 * np.sin(tick / 10)
        given = plant.drive(20 * (target - seen.q[:, 0]) - 0.2 * seen.qd[:, 0])
        rows.append(np.concatenate([legs.state, given, legs.measured_q, legs.measured_torque], 1))
    return np.array(rows)


def steps_until_motion(robot):
    """Return how many physics steps pass before a torque moves the hip."""
    legs = MujocoSimulator(robot, 1, rate=2000, threads=1, clamped=True)
    legs.place(slice(None), 1.0, np.zeros(2))
    for step in range(60):
        legs.step(np.array([[3.0, 0.0]]))
        if abs(legs.qd[0, 0]) > 1e-6:
            return step
    raise AssertionError("the leg never moved")


@pytest.mark.parametrize("name", ["legv2", "legv2-paper"])
def test_effects_without_effect_leave_every_byte(name):
    robot = load_robot(name)
    idle = with_reality(robot, hip=IDLE)
    assert MujocoSimulator(idle, 1, threads=1).mismatch is not None
    assert MujocoSimulator(robot, 1, threads=1).mismatch is None
    assert (
        tracked(idle, disturbance=NoiseAndDelay()).tobytes()
        == tracked(robot, disturbance=NoiseAndDelay()).tobytes()
    )


def test_a_neutral_table_does_not_change_the_digest():
    assert load_robot("legv2-paper").has_digest("9634a0cc2dd452ea")
    assert load_robot("legv2").has_digest("a599bb119353a5f1")
    assert with_reality(hip=DriveMismatch(backlash=1e-3)).digest != CAD.digest


@pytest.mark.parametrize(
    ("name", "disturbance"), [("twin", NO_NOISE), ("legv2-paper", NoiseAndDelay())]
)
def test_same_seed_same_bytes_at_any_thread_count(name, disturbance):
    robot = load_robot(name)
    one, other, *more = (
        tracked(robot, seed=seed, disturbance=disturbance, threads=threads).tobytes()
        for seed, threads in ((4, 1), (5, 1), (4, 2), (4, 3))
    )
    assert more == [one, one]
    assert one != other


@pytest.mark.parametrize("name", ["twin", "legv2"])
def test_a_run_goes_on_exactly_from_its_state(name):
    robot = load_robot(name)

    def plant(seed):
        legs = MujocoSimulator(robot, 2, threads=1)
        legs.stand(slice(None), POSTURE)
        made = Plant(legs, NoiseAndDelay(), None, np.random.default_rng(seed))
        made.channel.restart(slice(None), legs.measured_q, legs.measured_qd, np.zeros(2))
        return made

    def go(made, ticks):
        seen = []
        for _ in range(ticks):
            q = made.sense(np.zeros(2)).q[:, 0]
            seen += [q.tobytes(), made.drive(20 * (POSTURE - q)).tobytes()]
        return seen

    one, other = plant(1), plant(2)
    go(one, 30)
    physics, channel = one.legs.batch.state.copy(), one.channel.state()
    rest = go(one, 30)
    go(other, 7)
    other.legs.batch.state[:] = physics
    other.channel.restore(channel)
    assert go(other, 30) == rest


@pytest.mark.parametrize("late", [1, 4, 9, 15])
def test_latency_shifts_the_response_by_the_stated_time(late):
    prompt = steps_until_motion(with_reality(hip=IDLE))
    robot = with_reality(latency=Latency(command=late * 5e-4))
    assert steps_until_motion(robot) - prompt == late


def test_a_late_measurement_is_the_state_of_that_time():
    legs = MujocoSimulator(
        with_reality(latency=Latency(measurement=3 * 5e-4)), 1, rate=2000, threads=1
    )
    legs.place(slice(None), 2.0, POSTURE)
    past = []
    for _ in range(30):
        past.append(legs.q.copy())
        legs.step(np.array([[2.0, -1.0]]))
    past.append(legs.q.copy())
    np.testing.assert_allclose(legs.measured_q, past[-4], atol=1e-12)


def test_jitter_spreads_over_its_range_and_never_reorders():
    robot = with_reality(latency=Latency(command=0.002, jitter=0.002))
    legs = MujocoSimulator(robot, 200, threads=1)
    legs.place(slice(None), 5.0, POSTURE)
    for tick in range(6):
        # The command counts up, so that a falling torque would be a command overtaken.
        torque = np.full((200, 2), 0.1 * (tick + 1))
        before = legs.mismatch.drive.motor_torque.copy()
        given = legs.step(torque)
        assert (given >= before - 1e-12).all()
    share = (0.6 - given[:, 0]) / 0.1
    # 2 to 4 ms of the 5 ms period still hold the command before.
    assert set(np.round(share * 10).astype(int)) == {4, 5, 6, 7, 8}
    assert share.mean() == pytest.approx(0.6, abs=0.03)


@pytest.mark.parametrize("joint", ["hip", "knee"])
@pytest.mark.parametrize("stiffness", [None, 300.0])
def test_backlash_leaves_a_dead_band_of_its_width(joint, stiffness):
    width, index = 0.02, ["hip", "knee"].index(joint)
    limp = dataclasses.replace(
        CAD,
        hip=dataclasses.replace(CAD.hip, friction=5.0),
        knee=dataclasses.replace(CAD.knee, friction=5.0),
    )
    drive = DriveMismatch(backlash=width, stiffness=stiffness, stiffness_damping=0.01)
    legs = hanging(with_reality(limp, **{joint: drive}))
    gaps = []
    for side in (-1.0, 1.0):
        # Friction holds the motor; gravity swings the link to the side's end of the gap.
        legs.place(slice(None), 1.0, np.eye(2)[index] * side)
        for _ in range(400):
            legs.step(np.zeros((1, 2)))
        gaps.append((legs.q - legs.measured_q)[0, index])
    lever = CAD.shank.mass * CAD.shank.com + (joint == "hip") * CAD.thigh.mass * CAD.thigh.com
    sag = 0.0 if stiffness is None else 2 * 9.81 * lever / stiffness
    assert gaps[0] - gaps[1] == pytest.approx(width + sag, rel=0.2)
    assert gaps[0] - gaps[1] >= width * 0.99


def test_a_belt_yields_by_torque_over_stiffness():
    limp = dataclasses.replace(CAD, knee=dataclasses.replace(CAD.knee, friction=5.0))
    soft = DriveMismatch(stiffness=20.0, stiffness_damping=0.05)
    legs = hanging(with_reality(limp, knee=soft, hip=DriveMismatch(stiction_speed=1.0)))
    legs.place(slice(None), 1.0, np.array([0.0, -np.pi / 2]))
    for _ in range(600):
        legs.step(20 * (np.zeros(2) - legs.measured_q) * [1, 0] - 0.5 * legs.measured_qd * [1, 0])
    q = legs.q[0].sum()
    torque = -9.81 * CAD.shank.mass * CAD.shank.com * np.sin(q)
    assert (legs.q - legs.measured_q)[0, 1] == pytest.approx(torque / 20.0, rel=0.02)


def test_a_belt_too_stiff_for_the_step_is_refused():
    with pytest.raises(RobotError, match=r"reality.knee.stiffness"):
        MujocoSimulator(with_reality(knee=DriveMismatch(stiffness=1e6)), 1, threads=1)


def test_gain_lag_and_limits_shape_the_motor_torque():
    drive = DriveMismatch(torque_gain=0.9, torque_lag=0.01, torque_limit=4.0)
    legs = hanging(with_reality(hip=drive, knee=DriveMismatch(torque_limit=8.0)))
    seen = []
    for _ in range(20):
        legs.step(np.array([[3.0, 0.0]]))
        seen.append(legs.measured_torque[0, 0])
    time = 0.005 * np.arange(1, 21)
    np.testing.assert_allclose(seen, 2.7 * (1 - np.exp(-time / 0.01)), rtol=1e-9)
    legs.place(slice(None), 1.0, np.zeros(2))
    hip, knee = legs.step(np.full((1, 2), 50.0))[0]
    assert 0 < hip < 0.9 * 4.0
    assert knee == 8.0


def test_a_lower_voltage_lowers_the_speed_line():
    legs = MujocoSimulator(with_reality(voltage=0.5), 1, threads=1)
    legs.place(slice(None), 5.0, np.zeros(2))
    legs.qd[0, 1] = 0.5 * CAD.knee.no_load_speed
    assert legs.step(np.array([[0.0, 9.0]]))[0, 1] == 0.0
    legs.place(slice(None), 5.0, np.zeros(2))
    assert legs.step(np.array([[0.0, 50.0]]))[0, 1] == pytest.approx(16.0)


def test_a_gear_takes_from_driving_and_adds_to_braking():
    legs = MujocoSimulator(with_reality(knee=DriveMismatch(efficiency=0.8)), 2, threads=1)
    legs.place(slice(None), 5.0, np.zeros(2))
    legs.qd[:, 1] = [5.0, -5.0]
    given = legs.step(np.array([[0.0, 1.0], [0.0, 1.0]]))[:, 1]
    assert given[0] == pytest.approx(0.8, rel=1e-3)
    assert given[1] == pytest.approx(1 / 0.8, rel=1e-2)
    np.testing.assert_allclose(legs.measured_torque[:, 1], 1.0)


def test_ripple_repeats_with_the_motor_angle_and_has_its_amplitude():
    drive = with_reality(hip=DriveMismatch(ripple=0.1, ripple_periods=8.0))
    legs = MujocoSimulator(drive, 64, rate=2000, threads=1, clamped=True)
    angles = np.linspace(0, 2 * np.pi / 8, 64, endpoint=False)
    legs.place(slice(None), 1.0, np.stack([angles, np.zeros(64)], axis=1))
    given = legs.step(np.ones((64, 2)))[:, 0]
    np.testing.assert_allclose(given, 1 + 0.1 * np.sin(8 * angles), atol=1e-9)


@pytest.mark.parametrize(("torque", "moves"), [(0.55, False), (0.7, True)])
def test_stiction_holds_up_to_its_share_of_friction(torque, moves):
    sticky = dataclasses.replace(CAD, hip=dataclasses.replace(CAD.hip, friction=0.4))
    legs = hanging(with_reality(sticky, hip=DriveMismatch(stiction=1.5)))
    for _ in range(20):
        legs.step(np.array([[torque, 0.0]]))
    # MuJoCo's friction creeps; only what moves leaves the neighbourhood of zero.
    assert (abs(legs.q[0, 0]) > 0.02) == moves
    slippery = hanging(with_reality(sticky, hip=IDLE))
    for _ in range(20):
        slippery.step(np.array([[0.55, 0.0]]))
    assert abs(slippery.q[0, 0]) > 0.02


def test_readings_are_multiples_of_the_sensors_steps():
    sensor = SensorMismatch(
        0.003, 0.02, 0.01, position_noise=1e-3, velocity_noise=0.1, torque_noise=0.05
    )
    legs = MujocoSimulator(
        with_reality(hip=DriveMismatch(sensor=sensor), knee=DriveMismatch(sensor=sensor)),
        4,
        threads=1,
    )
    legs.stand(slice(None), POSTURE)
    for _ in range(10):
        legs.step(np.full((4, 2), 1.234))
        readings = (legs.measured_q, legs.measured_qd, legs.measured_torque)
        for reading, step in zip(readings, (0.003, 0.02, 0.01), strict=True):
            np.testing.assert_allclose(reading / step, np.round(reading / step), atol=1e-9)
    assert not np.isclose(legs.q / 0.003, np.round(legs.q / 0.003)).all()


def test_noise_has_the_stated_spread_and_leaves_the_physics_alone():
    noisy = SensorMismatch(position_noise=2e-3, velocity_noise=0.1, torque_noise=0.05)
    legs = MujocoSimulator(with_reality(hip=DriveMismatch(sensor=noisy)), 2000, threads=1)
    legs.place(slice(None), 5.0, POSTURE)
    legs.step(np.ones((2000, 2)))
    error = legs.measured_q - legs.q
    assert error[:, 0].std() == pytest.approx(2e-3, rel=0.05)
    assert (error[:, 1] == 0).all()
    assert (legs.measured_qd - legs.qd)[:, 0].std() == pytest.approx(0.1, rel=0.05)
    assert legs.measured_torque[:, 0].std() == pytest.approx(0.05, rel=0.05)
    assert np.ptp(legs.q, axis=0).max() == 0.0


def test_true_masses_and_ground_reach_the_physics_alone():
    robot = with_reality(mass=MassScale(thigh=1.2), ground=GroundMismatch(time_constant=0.05))
    model = mismatch_model(robot, 5e-4, clamped=False).model
    assert model.body("thigh").mass[0] == pytest.approx(1.2 * CAD.thigh.mass)
    assert model.body("thigh").inertia.max() == pytest.approx(1.2 * CAD.thigh.inertia)
    np.testing.assert_allclose(model.geom("floor").solref, [0.05, CAD.contact.damping_ratio])
    assert robot.mass == CAD.mass
    assert robot.contact == CAD.contact


def test_a_clamped_base_stays_and_its_leg_swings():
    legs = MujocoSimulator(load_robot("legv2-paper"), 2, threads=1, clamped=True)
    legs.place(slice(None), 0.1, POSTURE)
    for _ in range(100):
        legs.step(np.zeros((2, 2)))
    assert (legs.height == 0.1).all()
    assert (legs.height_rate == 0.0).all()
    assert np.abs(legs.q - POSTURE).max() > 0.1


def test_what_is_written_to_the_state_moves_motor_and_link():
    legs = MujocoSimulator(load_robot("twin"), 2, threads=1)
    legs.place(slice(None), 3.0, POSTURE)
    legs.qd[0] = [3.0, -2.0]
    legs.step(np.zeros((2, 2)))
    np.testing.assert_allclose(legs.q[0] - POSTURE, [0.015, -0.01], atol=5e-3)
    assert np.abs(legs.q[1] - POSTURE).max() < 2e-3
