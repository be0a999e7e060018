import dataclasses
import re

import pytest

from hopping_leg.evaluate import EvaluationRun
from hopping_leg.evaluate.report import write_report
from hopping_leg.evaluate.video import Video

COMMAND = "hop evaluate spring --commands 0.25,0.35"


@pytest.fixture(scope="module")
def commanded(judged):
    return EvaluationRun(dataclasses.replace(judged.evaluation, command=COMMAND), judged.runs)


@pytest.fixture(scope="module")
def page(commanded):
    return write_report(commanded).decode()


def test_the_page_needs_nothing_from_outside(page):
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) >= 4
    assert all(source.startswith("data:") for source in sources)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page


def test_the_page_states_its_numbers_and_how_to_make_it_again(page, judged):
    assert COMMAND in page
    for row in judged.evaluation.summary:
        assert f"{1e3 * row.median_error_m:+.1f}" in page
        assert f">{row.hops}<" in page
    assert judged.evaluation.conditions["robot_digest"] in page
    assert "hop report figures TRACES/spring-staircase-0.parquet" in page


def test_the_same_evaluation_gives_the_same_page(page, commanded):
    assert write_report(commanded).decode() == page


@pytest.fixture
def without_figures(monkeypatch):
    """Skip the slow part where a test is about something else."""
    monkeypatch.setattr("hopping_leg.evaluate.report.draw_report_figures", lambda *_: [])


@pytest.mark.usefixtures("without_figures")
def test_names_are_escaped(judged):
    row = dataclasses.replace(judged.evaluation.summary[0], controller="<b>&")
    evaluation = dataclasses.replace(judged.evaluation, summary=[row], distributions=[])
    page = write_report(EvaluationRun(evaluation, judged.runs)).decode()
    assert "<b>" not in page
    assert "&lt;b&gt;&amp;" in page


@pytest.mark.usefixtures("without_figures")
def test_a_video_is_embedded_and_a_missing_one_explained(judged):
    videos = {"spring": Video(None, "egl: no display"), "other": Video(b"RIFF")}
    page = write_report(judged, videos).decode()
    assert "No video of spring: egl: no display" in page
    assert "data:image/webp;base64,UklGRg==" in page


def test_a_controller_that_never_hopped_is_reported(judged):
    nothing = float("nan")
    rows = [
        dataclasses.replace(r, hops=0, median_error_m=nothing, std_m=nothing)
        for r in judged.evaluation.summary
    ]
    empty = [{**entry, "apexes_m": []} for entry in judged.evaluation.distributions]
    evaluation = dataclasses.replace(judged.evaluation, summary=rows, distributions=empty)
    page = write_report(EvaluationRun(evaluation, judged.runs)).decode()
    assert "nan" not in re.sub(r"data:[^\"]*", "", page)
