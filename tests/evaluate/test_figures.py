import numpy as np
import polars as pl
import pytest

from hopping_leg.evaluate import figures as drawing
from hopping_leg.evaluate import metrics
from hopping_leg.evaluate.report import draw_report_figures
from hopping_leg.evaluate.trials import load_run, save_traces
from hopping_leg.figures import controller_colours, encode
from hopping_leg.hop_detection import find_hops
from hopping_leg.trace import Trace


def with_estimate(trace, offset=0.01):
    """A trace of a controller that is always ``offset`` too high, also about its last apex."""
    height = trace.column("height_m")
    hops = find_hops(height, trace.column("height_rate_m_s"), trace.column("foot_clearance_m"))
    apex = np.full(len(height), np.nan)
    for tick, value in zip(hops.tick, hops.apex, strict=True):
        apex[tick + 5 :] = value + offset
    columns = [
        pl.Series(metrics.ESTIMATED_HEIGHT, height + offset),
        pl.Series(metrics.ESTIMATED_APEX, apex),
    ]
    return Trace(trace.table.with_columns(columns), trace.header)


@pytest.fixture(scope="module")
def fixed(judged):
    return next(run.trace for run in judged.runs if run.trial.name == "fixed-0.350")


def test_controllers_beside_each_other_share_their_axes_and_keep_their_colours(fixed):
    weak = {"knee_command_nm": 0.1 * fixed.column("knee_command_nm")}
    slow = Trace(fixed.table.with_columns(**weak), fixed.header)
    flight, _, other, *_ = drawing.draw_phase_space({"strong": fixed, "weak": slow}).axes
    assert flight.get_xlim() == other.get_xlim()
    assert flight.get_ylim() == other.get_ylim()
    assert flight.collections[0].get_clim() == other.collections[0].get_clim()
    own = controller_colours(["precise"])["precise"]
    for names in (["mine", "precise"], ["precise", "mine"]):
        first = names.index("precise")
        drawn = drawing.draw_heights(dict.fromkeys(names, fixed)).axes[first].lines[0]
        assert drawn.get_color() == own
    five = ["mine", "precise", "a", "b", "energy-shaping"]
    assert len(set(controller_colours(five).values())) == 5


def test_the_gallery_from_stored_traces_is_the_reports(judged, tmp_path):
    again = [load_run(path) for path in save_traces(judged.runs, tmp_path)]
    assert [(r.controller, r.trial.kind, r.repeat) for r in again] == [
        (r.controller, r.trial.kind, r.repeat) for r in judged.runs
    ]
    assert again[0].trace.table.equals(judged.runs[0].trace.table)
    assert not again[1].trace.table.equals(again[0].trace.table), "repeats differ in their noise"
    before, after = (draw_report_figures(judged.evaluation, runs) for runs in (judged.runs, again))
    assert list(before) == list(after) == ["staircase", "sequence", "distributions", "phase-space"]
    labels = [a.get_xlabel() + a.get_ylabel() for f in before.values() for a in f.axes]
    assert all("/ " in label for label in labels), "axes have units"
    for kind in ("svg", "pdf", "png"):
        assert encode(after["staircase"], kind) == encode(before["staircase"], kind)


def test_an_estimators_bias_is_measured(fixed):
    found = metrics.judge_estimator("spring", [with_estimate(fixed, 0.01)])
    assert found.flight_bias_m == pytest.approx(0.01)
    assert found.stance_bias_m == pytest.approx(0.01)
    assert found.apex_bias_m == pytest.approx(0.01, abs=1e-4)
    assert found.flight_std_m == pytest.approx(0.0, abs=1e-9)
    assert found.apex_std_m == pytest.approx(0.0, abs=1e-4)
    assert found.hops > 10
    assert metrics.judge_estimator("spring", [fixed]) is None
