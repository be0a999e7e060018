import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.plan import make_plan
from hopping_leg.robot.model import TIMESTEP
from tests.identify.twin import LEG, changed, record, swing

FIXED = record(LEG, swing(1.0))
STANDING = record(LEG, swing(1.0, "rail"), "rail")
TORQUES = record(LEG, swing(1.0), onboard="torque")


def test_a_fixed_base_says_nothing_about_rail_and_contact():
    names = make_plan([FIXED], LEG).parameters.names
    assert not [n for n in names if n.startswith(("rail.", "contact."))]
    moving = make_plan([FIXED, STANDING], LEG).parameters.names
    assert {"rail.friction", "contact.time_constant"} <= set(moving)


def test_known_gains_are_kept_and_unknown_ones_are_fitted():
    assert "drive.knee.stiffness" not in make_plan([FIXED], LEG).parameters.names
    unknown = FIXED.with_metadata(stiffness=None)
    assert "drive.knee.stiffness" in make_plan([unknown], LEG).parameters.names
    doubtful = FIXED.with_metadata(gains_exact=False)
    plan = make_plan([doubtful], LEG)
    assert plan.start.get("drive.knee.stiffness") == FIXED.metadata.stiffness[1]


def test_windows_are_short_where_nothing_holds_the_leg():
    closed, opened = (make_plan([r], LEG).window for r in (FIXED, TORQUES))
    assert opened < closed
    assert make_plan([FIXED, STANDING], LEG).window <= 0.25


def test_the_paper_counts_positions_only():
    plan = make_plan([FIXED, STANDING], LEG, search="two-pass")
    assert (plan.scoring.torque, plan.scoring.robust) == (None, None)
    assert "thigh.inertia" in plan.parameters.names


def test_impossible_plans_get_a_sentence():
    with pytest.raises(UsageError, match="least-squares"):
        make_plan([FIXED], LEG, search="gradient")
    with pytest.raises(UsageError, match="at least one recording"):
        make_plan([], LEG)


def test_held_commands_are_simulated_with_the_step_of_training():
    assert make_plan([FIXED], LEG).timestep == TIMESTEP
    assert make_plan([TORQUES], LEG).timestep > TIMESTEP


def test_a_drive_at_its_limit_has_its_torque_speed_line_fitted():
    weak = FIXED.with_metadata(onboard="continuous", gains_exact=False)
    strong = weak.with_metadata(stiffness=(800.0, 800.0), damping=(0.0, 0.0))
    lines = {"hip.motor.peak_torque", "knee.motor.no_load_speed"}
    assert not lines & set(make_plan([weak], LEG).parameters.names)
    assert lines <= set(make_plan([strong], LEG).parameters.names)


def test_a_motor_is_not_believed_slower_than_its_joint_was_seen():
    name = "knee.motor.no_load_speed"

    def low(factor):
        fast = changed(FIXED, pl.col("knee_velocity_rad_s") * factor)
        (parameter,) = make_plan([fast], LEG, parameters=(name,)).parameters.parameters
        return parameter.low

    seen = np.quantile(np.abs(FIXED.array("velocity")[:, 1]), 0.999)
    known = LEG.knee.motor.no_load_speed
    assert low(0.0) == known / 4
    assert low(15 / seen) == pytest.approx(0.8 * 15 * LEG.knee.belt_ratio)
    assert low(100 / seen) == known


def test_friction_that_grows_with_load_shows_where_torques_are_known_and_carry_weight():
    def fitted(*recordings):
        return "knee.load_friction" in make_plan(recordings, LEG).parameters.names

    def on(rig, onboard):
        return FIXED.with_metadata(rig=rig, onboard=onboard)

    assert fitted(TORQUES)
    assert not fitted(FIXED)
    assert fitted(FIXED, on("rail", "zoh"))
    assert not fitted(on("rail", "continuous"))


def test_a_motors_gain_shows_where_its_torque_is_both_computed_and_measured():
    assert "knee.torque_gain" in make_plan([FIXED], LEG).parameters.names
    assert "knee.torque_gain" not in make_plan([TORQUES], LEG).parameters.names
