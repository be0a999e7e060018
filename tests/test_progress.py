import itertools
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.progress import LiveProgress, ShareProgress, TimeLeft, minutes, said_if_slow
from hopping_leg.rl.learner import RecentHops
from hopping_leg.rl.train import TrainingProgress
from hopping_leg.sim_to_real.jobs import Board


@pytest.mark.parametrize("option", [{"quiet": True}, {"lines": False}])
def test_quiet_work_and_a_bar_leave_the_lines_out(capsys, option):
    with LiveProgress("work", **option) as progress:
        progress._line("a line")
    shown = capsys.readouterr().err
    assert "a line" not in shown
    assert not shown or "quiet" not in option


def test_a_training_tells_only_what_it_knows(capsys, monkeypatch):
    now, hops = 0.0, RecentHops()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with TrainingProgress("fast seed 0") as progress:
        progress.update(0.0, 0, hops, "")
        now = 60.0
        hops.add(np.array([0.012, np.nan, -0.012]))
        progress.update(0.5, 1200, hops, " · best snapshot 9 mm")
    assert capsys.readouterr().err == (
        "fast seed 0 50 % · 2 hops · apex error 12 mm · 20 steps/s · best snapshot 9 mm"
        " · about 1:00 left\n"
    )


def test_a_study_counts_earlier_jobs_but_not_their_time(capsys, monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with Board(400.0) as board:
        board.finish("old", 200.0, new=False)
        now = 250.0  # twice as long as the weight of what is new says
        board.finish("new", 120.0)
        board.show(["last"])
        board.begin("another")
    assert capsys.readouterr().err == (
        "transfer 80 % · done: new · about 2:40 left\ntransfer 80 % · another · about 2:40 left\n"
    )
    now = 0.0
    with Board(400.0, at_once=2) as board:
        now = 60.0
        board.show(["running"], begun=120.0)
    assert capsys.readouterr().err == "transfer 30 % · running · about 2:20 left\n"


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (59.6, "1:00"), (3601, "60:01")])
def test_durations_are_minutes_and_seconds(seconds, text):
    assert minutes(seconds) == text


def told(work):
    """Return (passed, share, told, said) after each report of work: its time and share so far."""
    left, rows = TimeLeft(), []
    for passed, share in work:
        said = left.text(left.reckon(passed, share))
        rows.append((passed, share, left.told, said))
    return rows


@given(st.lists(st.tuples(st.floats(0.1, 60), st.floats(0, 5)), min_size=2, max_size=60))
def test_the_time_left_never_rises_whatever_the_pace(steps):
    times, amounts = (np.cumsum(values) for values in zip(*steps, strict=True))
    shares = amounts / max(amounts[-1], 1e-9)
    rows = told(zip(times, shares, strict=True))
    lefts = [left for _, _, left, _ in rows]
    assert all(later <= earlier for earlier, later in itertools.pairwise(lefts))
    assert all(left > 0 for _, share, left, _ in rows if share < 1)


@given(st.floats(20, 5000), st.floats(0, 0.4), st.integers(10, 500))
def test_at_a_steady_pace_it_is_the_truth_and_after_a_slow_start_never_too_short(
    seconds, start, reports
):
    shares = np.linspace(0, 1, reports + 1)
    times = seconds * (start + (1 - start) * shares)
    times[0] = 0.0
    for passed, _, left, said in told(zip(times, shares, strict=True)):
        truth = seconds - passed
        if said:
            assert left >= truth - 1e-6
        if start == 0 and said:
            assert left == pytest.approx(truth, abs=1e-6)
            assert said.startswith("about")
        if passed > 2.5 * start * seconds and times[1] < passed / 10 and said:
            assert left == pytest.approx(truth, rel=0.05, abs=1e-6)


def test_work_that_slows_down_is_said_to_take_more_than_was_told():
    rows = told([(float(t), min(t, 50) / 100 + max(t - 50, 0) / 1000) for t in range(300)])
    assert rows[50][3] == "about 0:50 left"
    assert rows[100][3] == "more than 0:50 left"
    assert rows[299][2] <= 50


def test_lines_come_while_nothing_is_reported_and_say_which_part_it_is(capsys, monkeypatch):
    monkeypatch.setattr("hopping_leg.progress._SILENCE", 0.01)
    monkeypatch.setattr("hopping_leg.progress._LINE_SECONDS", 0.02)
    with ShareProgress(parts=2, first_line=0.0) as bar:
        bar.show("fast", 1.0)
        bar.show("slow", 0.25, ", soft floor")
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "1 of 2: fast 100 %"
    assert lines[-3:] == ["2 of 2: slow, soft floor 25 %"] * 3


@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("seconds", [0.0, 0.5])
def test_what_is_slow_says_what_it_does(capsys, monkeypatch, seconds, terminal):
    monkeypatch.setattr("hopping_leg.progress._SILENCE", 0.05)
    monkeypatch.setattr("hopping_leg.progress._LINE_SECONDS", 0.2)
    monkeypatch.setattr("rich.console.Console.is_terminal", terminal)
    with said_if_slow("Loading."):
        time.sleep(seconds)
    lines = capsys.readouterr().err.splitlines()
    assert bool(lines) == bool(seconds)
    assert ("Loading." in lines) == (terminal and seconds > 0)
    assert not lines or lines[-1].endswith("so far.")
