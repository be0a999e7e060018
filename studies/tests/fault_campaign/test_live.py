"""A computer that is too slow disturbs a trial; anything else that ends it is judged."""

import pytest

from hopping_leg.deploy.flight_recorder import SUFFIX, FlightRecorder
from studies.fault_campaign.live import _gave_up


@pytest.mark.parametrize(
    ("reason", "slow"), [("loop_stalled", True), ("drive_fault", False), (None, False)]
)
def test_a_host_that_was_too_slow_had_given_up_before_its_death(tmp_path, reason, slow):
    box = FlightRecorder(tmp_path / f"run{SUFFIX}", ("time_s",), {})
    box.row((0.0,))
    if reason:
        box.event(reason=reason)
    box.close()
    assert _gave_up(tmp_path) is slow


def test_a_host_that_left_no_readable_box_is_judged(tmp_path):
    assert not _gave_up(tmp_path)
    (tmp_path / f"run{SUFFIX}").write_bytes(b"")
    assert not _gave_up(tmp_path)
