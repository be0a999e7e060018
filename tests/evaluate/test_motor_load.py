import numpy as np
import polars as pl
import pytest

from hopping_leg.evaluate.motor_load import motor_load
from hopping_leg.robot import GRAVITY
from hopping_leg.sim import LOADS
from hopping_leg.trace import Trace
from tests.evaluate.test_metrics import sine_trace

TICKS = 200


def part(robot, **columns):
    """A second of a run that is at rest inside its limits but for what is given."""
    names = ("hip_command_nm", "knee_command_nm", "hip_soft_limit_nm", "knee_soft_limit_nm")
    data = {"time_s": np.arange(TICKS) / 200, **{n: np.zeros(TICKS) for n in (*names, *LOADS)}}
    for joint in ("hip", "knee"):
        limits = getattr(robot, joint)
        data[f"{joint}_position_rad"] = np.full(TICKS, (limits.lower + limits.upper) / 2)
    return Trace(
        pl.DataFrame({**data, **{n: np.broadcast_to(v, TICKS) for n, v in columns.items()}})
    )


def torque(robot, hip, knee):
    return part(robot, hip_mean_square_torque=hip**2, knee_mean_square_torque=knee**2)


def test_the_hotter_motor_limits_and_the_rated_torque_never_does(robot):
    rated = robot.hip.motor.rated_torque
    assert motor_load([torque(robot, rated, 0.0)], robot).thermal_minutes == np.inf
    hot = motor_load([torque(robot, np.sqrt(2) * rated, 0.0)], robot)
    assert hot.thermal_minutes == pytest.approx(578 * np.log(2) / 60)
    assert hot.rated_torque_share == pytest.approx(np.sqrt(2))
    geared = motor_load([torque(robot, 0.0, np.sqrt(2) * rated * 2)], robot)
    assert geared.thermal_minutes == pytest.approx(hot.thermal_minutes), "the belt doubles it"
    assert (geared.rms_hip_torque_nm, geared.rms_knee_torque_nm) == (0, np.sqrt(2) * rated * 2)


def test_power_of_motors_and_bus(robot):
    half = np.where(np.arange(TICKS) < 100, 30.0, -10.0)
    load = motor_load([part(robot, hip_power=half, knee_power=-5.0, least_power=-42.0)], robot)
    assert load.mean_power_w == pytest.approx(15)
    assert load.mean_electrical_power_w == pytest.approx(10 - 5)
    assert load.peak_regeneration_w == 42
    load, current = motor_load([torque(robot, 6.0, 0.0)], robot), 6.0 / (6 * 0.0788)
    assert load.mean_electrical_power_w == pytest.approx(1.5 * current**2 * 0.150), "windings"
    assert load.hip_heat_w == pytest.approx(load.mean_electrical_power_w)
    assert load.mean_power_w == load.knee_heat_w == 0


def test_the_peak_of_the_ground_force_is_the_median_of_those_of_runs(robot):
    weight = robot.mass * GRAVITY
    force = [part(robot, ground_force=weight * np.linspace(0, most, TICKS)) for most in (3, 9, 4)]
    assert motor_load(force, robot).peak_ground_force_weights == pytest.approx(4)


def test_the_bus_rises_by_what_is_not_used_up(robot):
    power = np.zeros(TICKS)
    power[50:60] = -100.0  # 5 J
    once = motor_load([part(robot, hip_power=power)], robot).bus_voltage_rise_v
    assert once == pytest.approx(np.sqrt(26**2 + 2 * 5 / 4e-3) - 26)
    power[61:71], power[72:82] = 100.0, -100.0
    again = motor_load([part(robot, hip_power=power)], robot).bus_voltage_rise_v
    assert again == pytest.approx(once), "what was stored is used first"
    half = motor_load([torque(robot, 6.0, 0.0), part(robot, hip_power=power)], robot)
    assert half.bus_voltage_rise_v == pytest.approx(once), "runs share no bus"


def test_reversals_are_changes_of_sign_by_more_than_four(robot):
    sign = np.where(np.arange(TICKS) % 2, 1.0, -1.0)
    for size, rate in ((2.1, 199), (1.9, 0)):
        load = motor_load([part(robot, knee_command_nm=size * sign)], robot)
        assert load.torque_reversals_hz == pytest.approx(rate)
    both = motor_load([part(robot, knee_command_nm=3 * sign, hip_command_nm=3 * sign)] * 2, robot)
    assert both.torque_reversals_hz == pytest.approx(2 * 199)
    jumps = part(robot, knee_command_nm=np.where(sign > 0, 9.0, 1.0))
    assert motor_load([jumps], robot).torque_reversals_hz == 0


def test_limits_and_stops(robot):
    angle = np.full(TICKS, robot.hip.upper - 0.1)
    angle[:50] += 0.2
    stop = np.zeros(TICKS)
    stop[[3, 4, 9]] = 1
    one = part(robot, hip_position_rad=angle, hip_soft_limit_nm=3.0, knee_soft_limit_nm=4.0,
               hip_command_nm=15.0, stop_contact=stop)  # fmt: skip
    load = motor_load([one, one], robot)
    assert load.outside_limits_fraction == 0.25
    assert load.soft_limit_share == pytest.approx(0.25)
    assert load.stop_contacts == 4


def test_of_a_leg_that_tells_nothing_nothing_is_known(robot):
    load = motor_load([sine_trace()], robot)
    assert np.isnan([load.rms_hip_torque_nm, load.thermal_minutes, load.mean_power_w]).all()
    assert np.isnan([load.bus_voltage_rise_v, load.peak_ground_force_weights]).all()
    assert load.stop_contacts is None
    assert load.torque_reversals_hz == 0, "the commanded torque is in every trace"
