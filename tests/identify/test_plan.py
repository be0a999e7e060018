import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.plan import make_plan
from tests.identify.twin import LEG, changed, record, swing

FIXED = record(LEG, swing(1.0))
STANDING = record(LEG, swing(1.0, "rail"), "rail")
TORQUES = record(LEG, swing(1.0), onboard="torque")


def on(rig="fixed-base", onboard="continuous", **gains):
    return FIXED.with_metadata(rig=rig, onboard=onboard, **gains)


STRONG = {"stiffness": (800.0, 800.0), "damping": (0.0, 0.0)}


@pytest.mark.parametrize(
    ("recordings", "fitted", "kept"),
    [
        ([FIXED], "knee.torque_gain", "rail.friction"),
        ([FIXED], "thigh.inertia", "contact.time_constant"),
        ([FIXED, STANDING], "rail.friction", "drive.knee.stiffness"),
        ([FIXED, STANDING], "contact.time_constant", "hip.armature"),
        ([on(onboard="zoh", stiffness=None)], "drive.knee.stiffness", "drive.knee.damping"),
        ([on(gains_exact=False)], "drive.knee.stiffness", "hip.motor.peak_torque"),
        ([on(gains_exact=False, **STRONG)], "hip.motor.peak_torque", "knee.load_friction"),
        ([on(gains_exact=False, **STRONG)], "knee.motor.no_load_speed", "rail.friction"),
        ([TORQUES], "knee.load_friction", "knee.torque_gain"),
        ([FIXED, on("rail", "zoh")], "knee.load_friction", "drive.hip.damping"),
        ([FIXED], "hip.friction", "knee.load_friction"),
        ([on("rail")], "rail.friction", "knee.load_friction"),
    ],
)
def test_what_recordings_can_tell_is_fitted_and_what_is_known_is_kept(recordings, fitted, kept):
    names = make_plan(recordings, LEG).parameters.names
    assert fitted in names
    assert kept not in names


def test_doubtful_gains_are_where_the_search_begins():
    plan = make_plan([FIXED.with_metadata(gains_exact=False)], LEG)
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
