import re
from dataclasses import replace

import pytest

from hopping_leg.evaluate import EvaluationRun
from hopping_leg.evaluate.report import write_report
from hopping_leg.evaluate.tables import verdict

COMMAND = "hop evaluate spring --commands 0.25,0.35"


@pytest.fixture(scope="module")
def page(judged):
    commanded = EvaluationRun(replace(judged.evaluation, command=COMMAND), judged.runs)
    page = write_report(commanded).decode()
    assert write_report(commanded).decode() == page, "the same evaluation has the same bytes"
    return page


def test_the_page_needs_nothing_from_outside(page):
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) >= 4
    assert all(source.startswith("data:") for source in sources)
    assert not [word for word in ("<script", "@import", "url(") if word in page]


def test_the_page_states_its_numbers_and_how_to_make_it_again(page, judged):
    assert COMMAND in page
    for row in judged.evaluation.summary:
        assert f"{1e3 * row.median_error_m:+.1f}" in page
        assert f">{row.hops}<" in page
    assert judged.evaluation.conditions["robot_digest"] in page


def test_names_are_escaped(judged, monkeypatch):
    monkeypatch.setattr("hopping_leg.evaluate.report.draw_report_figures", lambda *_: {})
    row = replace(judged.evaluation.summary[0], controller="<b>&")
    evaluation = replace(judged.evaluation, summary=[row], distributions=[])
    page = write_report(EvaluationRun(evaluation, judged.runs)).decode()
    assert "<b>" not in page
    assert "&lt;b&gt;&amp;" in page


def test_a_verdict_names_the_worst_height_and_everything_that_went_wrong(judged):
    low, high = judged.evaluation.summary
    low = replace(low, median_error_m=-0.001, skipped_hops=0, body_contacts=0)
    changes = {"median_error_m": 0.0034, "skipped_hops": 2, "hops": 98 - low.hops}
    high = replace(high, **changes, body_contacts=1)

    def said(*rows):
        evaluation = replace(judged.evaluation, summary=list(rows), ladder=[])
        return verdict(evaluation, "spring")

    assert said(low, high) == (
        "misses its command by 2.2 mm in the median of 2 heights and by 3.4 mm at the worst,"
        " 0.35 m; skips 2 of 100 hops; base or knee touch the ground 1 times."
    )
    still = replace(high, hops=0, median_error_m=float("nan"))
    silent = replace(judged.evaluation, summary=[still], distributions=[])
    page = write_report(EvaluationRun(silent, judged.runs)).decode()
    assert "nan" not in re.sub(r"data:[^\"]*", "", page)
    assert "does not hop at 0.35 m" in said(low, still)
    assert said(still) == "does not hop at any height."
