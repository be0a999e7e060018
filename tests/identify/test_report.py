import dataclasses

import numpy as np
import pytest

from hopping_leg.identify.report import parameter_table, quality_table, write_fit_report
from hopping_leg.identify.report_figures import residual_spectrum, worst_stretch
from hopping_leg.identify.validation import overlays
from hopping_leg.robot import load_robot
from tests.identify.fitting import identified, run
from tests.identify.twin import LEG, changed, record, swing


@pytest.fixture(scope="module")
def page():
    return write_fit_report(identified(), "hop identify")


def drawn(recordings):
    found = identified()
    return overlays(recordings, (found.start, found.hypothesis), found.plan.timestep)


def test_the_page_holds_every_part_and_needs_nothing(page):
    page = page.decode()
    for part in ("hip.friction", "Residual spectra", "Course of the cost", "Provenance", "swing"):
        assert part in page
    assert page.count("data:image/svg+xml") == 4
    assert "http" not in page.replace("http://www.w3.org", "")


def test_the_same_result_gives_the_same_page(page):
    assert write_fit_report(identified(), "hop identify") == page


def test_only_the_papers_leg_is_held_against_the_paper():
    found = identified()
    text = str(parameter_table(found))
    assert "0.4364" in text
    assert "0.1441" in text
    start = dataclasses.replace(found.start, robot=load_robot("legv1"))
    text = str(parameter_table(dataclasses.replace(found, start=start)))
    assert "Table I" not in text


def test_where_nothing_was_measured_there_is_a_dash():
    found = identified()
    validation = dataclasses.replace(found.validation, closed_loop_torque=(np.nan, np.nan))
    text = str(quality_table(dataclasses.replace(found, validation=validation)))
    assert text.count('<td class="">-</td>') == 2


def test_the_fit_lies_on_what_was_measured():
    (overlay,) = drawn([run(1.0)])
    before, after = np.nanmax(np.abs(overlay.errors("position")), axis=(1, 2))
    assert after < 0.05 * before
    assert np.isnan(overlay.measured["position"][:100]).all()
    assert not np.isnan(overlay.measured["position"][100:]).any()


def test_torque_driven_recordings_are_started_anew():
    (overlay,) = drawn([record(LEG, swing(2.0), onboard="torque")])
    assert overlay.restarted
    starts = overlay.simulated["position"][:, ::100]
    np.testing.assert_array_equal(starts[0], starts[1])


def test_a_long_recording_is_drawn_where_it_fits_worst():
    table = run().trace.table
    bent = np.where(np.arange(600) > 400, 0.2, 0.0) + table["hip_position_rad"].to_numpy()
    long = changed(run(), hip_position_rad=bent, time_s=3 * table["time_s"].to_numpy())
    long = long.with_metadata(rate_hz=100 / 3)
    (overlay,) = drawn([long])
    rows = worst_stretch(overlay)
    assert rows.start > 300
    assert rows.stop - rows.start == pytest.approx(200, abs=1)


def test_a_spectrum_shows_amplitude_where_the_error_is():
    (overlay,) = drawn([run(1.0)])
    wave = 0.02 * np.sin(2 * np.pi * 5.0 * overlay.recording.time)
    position = overlay.simulated["position"][-1] + wave[:, None]
    scattered = np.where(np.random.default_rng(0).random(position.shape) < 0.4, position, np.nan)
    frequency, amplitude = residual_spectrum(
        [dataclasses.replace(overlay, measured={"position": scattered})], "position", 0, -1
    )
    peak = amplitude.argmax()
    assert frequency[peak] == pytest.approx(5.0, rel=0.05)
    assert amplitude[peak] == pytest.approx(0.02, rel=0.2)
