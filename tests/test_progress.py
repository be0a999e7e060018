import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.progress import Progress, minutes, said_if_slow
from hopping_leg.rl.learner import RecentHops
from hopping_leg.rl.train import TrainingProgress


def test_a_training_tells_only_what_it_knows(monkeypatch):
    now, hops = 0.0, RecentHops()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    progress = TrainingProgress("fast seed 0")
    progress.update(0.25, 0, hops, "")
    assert progress.text == "fast seed 0 25 % · 0 hops"
    now = 60.0
    hops.add(np.array([0.012, np.nan, -0.012]))
    progress.update(0.5, 1200, hops, " · best snapshot 9 mm")
    assert progress.text == (
        "fast seed 0 50 % · 2 hops · apex error 12 mm · 20 steps/s · best snapshot 9 mm"
        " · about 2:00 left"
    )


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (59.6, "1:00"), (3601, "60:01")])
def test_durations_are_minutes_and_seconds(seconds, text):
    assert minutes(seconds) == text


@given(st.lists(st.tuples(st.floats(0, 1e300), st.floats(0, 1))))
def test_no_time_left_ends_the_work(reports):
    now = 0.0
    bar = Progress()
    bar._bar.get_time = lambda: now
    for now, share in reports:  # noqa: B007
        bar.show("work", share)
        assert "inf" not in bar.text
        assert "nan" not in bar.text


def test_lines_come_while_nothing_is_reported_and_say_which_part_it_is(capsys, monkeypatch):
    monkeypatch.setattr("hopping_leg.progress._SILENCE", 0.01)
    monkeypatch.setattr("hopping_leg.progress._LINE_SECONDS", 0.02)
    with Progress(parts=2) as bar:
        bar.show("fast", 1.0)
        bar.show("slow", 0.25, about=", soft floor")
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-3:] == ["2 of 2: slow, soft floor 25 %"] * 3


@pytest.mark.parametrize("terminal", [True, False])
def test_what_is_slow_says_what_it_does(capsys, monkeypatch, terminal):
    monkeypatch.setattr("hopping_leg.progress._SILENCE", 0.05)
    monkeypatch.setattr("hopping_leg.progress._LINE_SECONDS", 10.0)
    monkeypatch.setattr("rich.console.Console.is_terminal", terminal)
    with said_if_slow("Loading."):
        time.sleep(0.3)
    assert ("Loading." in capsys.readouterr().err.splitlines()) == terminal
