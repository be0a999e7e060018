"""Measured torques are held against the stated PD: sign, unit, gear side and rows."""

import numpy as np
import polars as pl
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hopping_leg.errors import RecordingError
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.recording_format import PAIRS
from tests.identify.twin import tracked

JOINTS = st.sampled_from([0, 1])


def load(table, **changes):
    metadata = tracked().with_metadata(**changes).metadata
    return make_recording(table, metadata, "log.csv")


def test_the_torque_of_a_stated_pd_is_believed():
    assert load(tracked().trace.table).warnings == ()


@settings(max_examples=15)
@given(joint=JOINTS, factor=st.floats(0.02, 20.0), side=st.sampled_from([-1, 1]))
def test_another_sign_or_unit_of_the_torque_is_refused(joint, factor, side):
    assume(side < 0 or not 0.7 < factor < 1.4)
    column = PAIRS["torque"][joint]
    wrong = tracked().trace.table.with_columns(pl.col(column) * (side * factor))
    says = "opposite sign|cannot be in N m" if side < 0 else "times what was|cannot be in N m"
    with pytest.raises(RecordingError, match=f"'{column}'.*({says})"):
        load(wrong)


@pytest.mark.parametrize("late", [-1, 1, 3, 5])
def test_rows_that_are_late_or_early_are_named(late):
    table = tracked().trace.table.with_columns(pl.col(PAIRS["torque"]).shift(late))
    says = f"follows the stated PD {'early' if late < 0 else 'late'}, by .* {abs(late)} of its rows"
    if 0 < late < 4:
        assert all(says.split(" by ")[0] in warning for warning in load(table).warnings)
        assert len(load(table).warnings) == 2
    else:
        with pytest.raises(RecordingError, match=says):
            load(table)


def test_torques_of_other_gains_or_columns_are_refused():
    table = tracked().trace.table
    with pytest.raises(RecordingError, match="times what was asked for"):
        load(table, stiffness=(20.0, 20.0), damping=(0.75, 0.75))
    hip, knee = PAIRS["torque"]
    with pytest.raises(RecordingError, match=r"what was asked for|does not follow|opposite"):
        load(table.rename({hip: knee, knee: hip}))
    guesses = load(table, stiffness=(20.0, 20.0), damping=(0.75, 0.75), gains_exact=False)
    assert guesses.warnings == ()


def test_after_command_rows_are_put_beside_their_commands():
    table = tracked().trace.table
    commands = [c for name in ("position_command", "velocity_command") for c in PAIRS[name]]
    later = table.with_columns(pl.col(commands).shift(1)).slice(1)
    recording = load(later, sample="after-command")
    assert recording.warnings == ()
    assert recording.metadata.sample == "before-command"
    np.testing.assert_array_equal(
        recording.array("position_command"), tracked().array("position_command")[1:-1]
    )
