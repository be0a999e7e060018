"""Jobs are done once, and the time left is true."""

import dataclasses
import os
import time
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import pytest

from hopping_leg.sim_to_real import jobs
from hopping_leg.sim_to_real.jobs import Board, Job, work


@dataclasses.dataclass(frozen=True)
class Note(Job):
    """A job that writes down which process did it."""

    file: Path
    seconds: float = 0.0
    weight: ClassVar[float] = 1.0

    @property
    def name(self):
        return self.file.stem

    @property
    def done(self):
        return self.file.exists()

    def run(self, *, quiet):
        time.sleep(self.seconds)
        self.file.write_text(str(os.getpid()))


@pytest.mark.parametrize("at_once", [1, 2])
def test_jobs_that_are_done_are_not_done_again(tmp_path, at_once, capsys):
    notes = [Note(tmp_path / f"{number}.txt") for number in range(3)]
    notes[1].file.write_text("earlier")
    with Board(3.0, own_bars=at_once == 1) as board:
        work(notes, at_once, board)
    assert notes[1].file.read_text() == "earlier"
    here = {job.file.read_text() for job in (notes[0], notes[2])} == {str(os.getpid())}
    assert here == (at_once == 1)
    assert "done: 2" in capsys.readouterr().err


@pytest.mark.parametrize("pace", [0.5, 1.0, 4.0])
def test_the_time_left_is_true_to_a_factor_of_two_after_the_first_tenth(pace, monkeypatch):
    known = {}

    def job(name, weight, *, on_all_cores=False):
        told = SimpleNamespace(name=name, weight=weight, on_all_cores=on_all_cores, done=False)
        told.progress = lambda: (known.get(name, 0.0), str(known.get(name)))
        return told

    rounds = [[job("record", 5.0)] * 2, [job("identify", 40.0, on_all_cores=True)]]
    rounds += [[job("train", 190.0)] * 2, [job("hop", 8.0)] * 2]
    total = 100.0 + sum(one.weight for stage in rounds for one in stage)
    now, since, whole = 0.0, {}, pace * total / 2
    monkeypatch.setattr(time, "monotonic", lambda: now)
    board = Board(total, at_once=2)
    for stage in rounds:
        begin, taken = now, pace * sum(one.weight for one in stage) / 2
        while now < begin + taken:
            known["train"] = (now - begin) / taken // 0.2 * 0.2  # its snapshots tell
            jobs._show(stage, since, board)
            said = board.text
            if 0.1 * whole < now < 0.95 * whole:
                left = said.rpartition(" left")[0].split()[-1].split(":")
                assert 0.5 < (60 * int(left[0]) + int(left[1])) / (whole - now) < 2.0
            now += 1.0
        for one in stage:
            board.finish(one.name, one.weight)
