"""Jobs are done once."""

import dataclasses
import os
import time
from pathlib import Path
from typing import ClassVar

import pytest

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
    jobs = [Note(tmp_path / f"{number}.txt") for number in range(3)]
    jobs[1].file.write_text("earlier")
    with Board(3.0, own_bars=at_once == 1) as board:
        work(jobs, at_once, board)
    assert jobs[1].file.read_text() == "earlier"
    here = {job.file.read_text() for job in (jobs[0], jobs[2])} == {str(os.getpid())}
    assert here == (at_once == 1)
    assert "done: 2" in capsys.readouterr().err
