"""Jobs are done once, and end with their study."""

import contextlib
import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hopping_leg.sim_to_real.board import Board
from hopping_leg.sim_to_real.work import work


@dataclasses.dataclass(frozen=True)
class Note:
    """A job that writes down which process did it."""

    file: Path
    seconds: float = 0.0
    weight = 1.0

    @property
    def name(self):
        return self.file.stem

    @property
    def done(self):
        return self.file.exists()

    def run(self, *, quiet):
        time.sleep(self.seconds)
        self.file.write_text(str(os.getpid()))

    def progress(self):
        return 0.5, ""


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


_KILLED = """
import sys
from pathlib import Path
from hopping_leg.sim_to_real.board import Board
from hopping_leg.sim_to_real.work import work
from tests.sim_to_real.test_work import Note
if __name__ == "__main__":
    with Board(2.0) as board:
        work([Note(Path(sys.argv[1]) / f"{n}.txt", 300.0) for n in range(2)], 2, board)
"""


@pytest.mark.slow
def test_no_job_outlives_a_killed_study(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(_KILLED)
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
        stderr=subprocess.DEVNULL,
    )
    _wait(lambda: len(_children(process.pid)) >= 2)
    children = _children(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    _wait(lambda: not any(Path(f"/proc/{child}/cmdline").exists() for child in children))
    assert not list(tmp_path.glob("*.txt"))


def _children(parent: int) -> list[int]:
    """Return the processes that a process has begun."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if (entry / "stat").read_text().rsplit(")", 1)[1].split()[1] == str(parent):
                found.append(int(entry.name))
    return found


def _wait(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.2)
