import pytest

from hopping_leg.evaluate import figures as drawing
from hopping_leg.evaluate.report import draw_report_figures
from hopping_leg.evaluate.trials import load_run
from hopping_leg.figures import controller_colours, encode
from hopping_leg.trace import Trace


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
    own = controller_colours(["rl"])["rl"]
    for names in (["mine", "rl"], ["rl", "mine"]):
        first = names.index("rl")
        drawn = drawing.draw_heights(dict.fromkeys(names, fixed)).axes[first].lines[0]
        assert drawn.get_color() == own
    five = ["mine", "rl", "a", "b", "energy-shaping"]
    assert len(set(controller_colours(five).values())) == 5


def test_the_gallery_from_stored_traces_is_the_reports(judged, tmp_path):
    for run in judged.runs:
        run.trace.save(tmp_path / run.file_name)
    again = [load_run(tmp_path / run.file_name) for run in judged.runs]
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
