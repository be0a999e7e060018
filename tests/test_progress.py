import time

import numpy as np
import pytest

from hopping_leg.progress import LiveProgress, minutes
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
        "fast seed 0 0 % · 0 hops\n"
        "fast seed 0 50 % · 2 hops · apex error 12 mm · 20 steps/s · best snapshot 9 mm\n"
    )


def test_a_study_counts_earlier_jobs_but_not_their_time(capsys, monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with Board(400.0) as board:
        board.finish("old", 200.0, new=False)
        now = 250.0  # twice as long as the weight of what is new says
        board.finish("new", 120.0)
        board.show(["last"])
    assert capsys.readouterr().err == "80 % · done: new\n80 % · last · about 2:40 left\n"
    now = 0.0
    with Board(400.0, at_once=2) as board:
        now = 60.0
        board.show(["running"], begun=120.0)
    assert capsys.readouterr().err == "30 % · running · about 2:20 left\n"


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (59.6, "1:00"), (3601, "60:01")])
def test_durations_are_minutes_and_seconds(seconds, text):
    assert minutes(seconds) == text
