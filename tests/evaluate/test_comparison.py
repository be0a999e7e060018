import dataclasses
import json
import re

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.evaluate import EvaluationRun
from hopping_leg.evaluate.comparison import set_beside, traces_of, write_comparison
from hopping_leg.evaluate.report import write_report
from hopping_leg.evaluate.result_files import evaluation_from, read_runs
from hopping_leg.evaluate.trials import save_traces
from hopping_leg.evaluate.verdict import verdict
from hopping_leg.evaluate.video import Video

TRAINING = {
    "recipe": "fast", "robot": "legv2-paper", "robot_digest": "abc", "seed": 0,
    "minutes": 5.0, "steps": 200, "selected": {"steps": 200, "score_m": 0.004},
    "history": [
        {"steps": 100, "minutes": 2.0, "score_m": 0.02},
        {"steps": 200, "minutes": 4.0, "score_m": 0.005},
    ],
    "command": "hop train --recipe fast",
}  # fmt: skip


@pytest.fixture(scope="module")
def folders(judged, tmp_path_factory):
    """Two folders of the same evaluation, the second on another leg; and two trainings."""
    root = tmp_path_factory.mktemp("runs")
    evaluation = judged.evaluation
    other = {**evaluation.conditions, "robot": "long-leg", "robot_digest": "xyz", "seeds": 9}
    for name, changed in (("a", evaluation.conditions), ("b", other)):
        content = dataclasses.replace(
            evaluation, conditions=changed, command=f"hop evaluate {name}"
        )
        (root / name).mkdir()
        (root / name / "evaluation.json").write_bytes(content.dumps())
    save_traces(judged.runs, root / "a" / "traces")
    for name in ("t0", "t1"):
        (root / name).mkdir()
        (root / name / "result.json").write_text(json.dumps(TRAINING))
    return root


def test_an_evaluation_survives_the_disk(judged):
    text = judged.evaluation.dumps()
    assert evaluation_from(json.loads(text)).dumps() == text


def test_runs_beside_each_other_keep_names_numbers_and_heights_and_say_how_they_differ(
    folders, judged
):
    compared = set_beside(read_runs([str(folders / "a"), str(folders / "b")]))
    assert compared.evaluation.controllers == ["a: spring", "b: spring"]
    errors = [row.median_error_m for row in compared.evaluation.rows("b: spring")]
    assert errors == pytest.approx([row.median_error_m for row in judged.evaluation.summary])
    drawn = {(run.controller, run.trial.kind) for run in traces_of(compared)}
    assert drawn == {("a: spring", "sequence"), ("a: spring", "staircase")}
    assert "robots differ: legv2-paper" in compared.notes[0]
    assert "long-leg (xyz) in b" in compared.notes[0]
    assert {"name": "seeds", "in a": "2", "in b": "9"} in compared.differences
    assert not set_beside(read_runs([f"x={folders / 'a'}", f"y={folders / 'a'}"])).differences


def test_the_page_holds_everything_and_needs_nothing(folders):
    names = [str(folders / name) for name in ("a", "b", "t0", "t1")]
    page = write_comparison(set_beside(read_runs(names)), "hop report page a b").decode()
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 5  # apexes, distributions, staircase, sequence, learning curves
    assert all(source.startswith("data:") for source in sources)
    for text in (">a: spring<", "hop evaluate b", "hop train --recipe fast", ">4.0<"):
        assert text in page


def test_runs_are_named_by_what_tells_them_apart(folders, tmp_path):
    runs = read_runs([str(folders / "t0" / "result.json"), f"mine={folders / 't1'}"])
    assert [run.label for run in runs] == ["t0", "mine"]


def test_what_cannot_be_compared_is_one_sentence(folders, tmp_path, judged):
    a, t0 = str(folders / "a"), str(folders / "t0")
    skills = tmp_path / "skills.json"
    skills.write_text('{"counted": []}')
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    unfinished = tmp_path / "unfinished"
    unfinished.mkdir()
    (unfinished / "config.json").write_text("{}")
    higher = [dataclasses.replace(row, command_m=0.5) for row in judged.evaluation.summary]
    lonely = tmp_path / "lonely.json"
    lonely.write_bytes(dataclasses.replace(judged.evaluation, summary=higher).dumps())
    for names, sentence in (
        ([a], "name two or more"),
        ([a, t0], "nothing in common"),
        ([a, a], "tell them apart with LABEL=PATH"),
        ([a, str(tmp_path / "none")], "There is no"),
        ([a, str(tmp_path)], "is not a run"),
        ([a, str(skills)], "not an evaluation by the paper's trials"),
        ([a, str(broken)], "not readable as JSON"),
        ([t0, str(unfinished)], "not finished; repeat the command that began it, with --resume"),
        ([a, str(lonely)], "no command in common"),
    ):
        with pytest.raises(UsageError, match=re.escape(sentence)):
            set_beside(read_runs(names))


COMMAND = "hop evaluate spring --commands 0.25,0.35"


@pytest.fixture(scope="module")
def commanded(judged):
    return EvaluationRun(dataclasses.replace(judged.evaluation, command=COMMAND), judged.runs)


@pytest.fixture(scope="module")
def page(commanded):
    return write_report(commanded).decode()


def test_the_page_needs_nothing_from_outside_and_is_the_same_again(page, commanded):
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) >= 4
    assert all(source.startswith("data:") for source in sources)
    assert not [word for word in ("<script", "@import", "url(") if word in page]
    assert write_report(commanded).decode() == page


def test_the_page_states_its_numbers_and_how_to_make_it_again(page, judged):
    assert COMMAND in page
    for row in judged.evaluation.summary:
        assert f"{1e3 * row.median_error_m:+.1f}" in page
        assert f">{row.hops}<" in page
    assert judged.evaluation.conditions["robot_digest"] in page
    assert "hop report figures TRACES/spring-staircase-0.parquet" in page


def test_names_are_escaped_a_video_is_embedded_and_a_missing_one_explained(judged, monkeypatch):
    monkeypatch.setattr("hopping_leg.evaluate.report.draw_report_figures", lambda *_: [])
    row = dataclasses.replace(judged.evaluation.summary[0], controller="<b>&")
    evaluation = dataclasses.replace(judged.evaluation, summary=[row], distributions=[])
    videos = {"spring": Video(None, "egl: no display"), "other": Video(b"RIFF")}
    page = write_report(EvaluationRun(evaluation, judged.runs), videos).decode()
    assert "<b>" not in page
    assert "&lt;b&gt;&amp;" in page
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


def test_a_verdict_names_the_worst_height_and_everything_that_went_wrong(judged):
    low, high = judged.evaluation.summary
    low = dataclasses.replace(low, median_error_m=-0.001, skipped_hops=0, body_contacts=0)
    changes = {"median_error_m": 0.0034, "skipped_hops": 2, "hops": 98 - low.hops}
    high = dataclasses.replace(high, **changes, body_contacts=1)

    def said(*rows):
        evaluation = dataclasses.replace(
            judged.evaluation, summary=list(rows), ladder=[], secondary=None
        )
        return verdict(evaluation, "spring")

    assert said(low, high) == (
        "misses its command by 2.2 mm in the median of 2 heights and by 3.4 mm at the worst,"
        " 0.35 m; skips 2 of 100 hops; base or knee touch the ground once."
    )
    still = dataclasses.replace(high, hops=0, median_error_m=float("nan"))
    assert "does not hop at 0.35 m" in said(low, still)
    assert said(still) == "does not hop at any height."
