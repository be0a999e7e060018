"""What one process holds at a time: others are told who has it, and a dead one holds nothing."""

import fcntl
import os
import socket
import subprocess
import sys
import tempfile
import tty
from pathlib import Path

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.locks import FOLDER_LOCK, Lock, hold_folder, named_lock

HOLDER = """
import sys, time
from pathlib import Path
from hopping_leg.errors import UsageError
from hopping_leg.locks import hold_folder
with hold_folder(Path(sys.argv[1]), UsageError):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_one_is_refused_until_the_first_gives_it_back():
    first = named_lock("test-a/b", "the bus", UsageError)
    with pytest.raises(UsageError, match="the bus is in use by"):
        named_lock("test-a/b", "the bus", UsageError)
    named_lock("test-a/c", "another bus", UsageError).close()
    first.close()
    first.close()
    named_lock("test-a/b", "the bus", UsageError).close()
    assert not list(Path(tempfile.gettempdir()).glob("hopping-leg-test-a*"))


def test_a_name_that_is_given_back_while_it_is_taken_has_one_holder(monkeypatch):
    first, flock = named_lock("test-a", "the bus", UsageError), fcntl.flock

    def late(descriptor, how):
        first.close()
        flock(descriptor, how)

    with monkeypatch.context() as patch:
        patch.setattr(fcntl, "flock", late)
        second = named_lock("test-a", "the bus", UsageError)
    with pytest.raises(UsageError, match="the bus is in use by"):
        named_lock("test-a", "the bus", UsageError)
    second.close()


def test_a_terminal_that_any_other_program_has_open_is_refused_with_its_name(tmp_path):
    master, slave = os.openpty()
    tty.setraw(slave)
    path = tmp_path / "link"
    path.symlink_to(os.ttyname(slave))
    Lock(path, str(path), UsageError).close()
    with subprocess.Popen(["sleep", "600"], stdin=slave) as other:
        with pytest.raises(UsageError, match=rf"in use by process {other.pid} \(sleep 600\)"):
            Lock(path, str(path), UsageError)
        other.kill()
    Lock(path, str(path), UsageError).close()
    os.close(master)
    os.close(slave)


def test_a_folder_belongs_to_one_process_and_a_killed_ones_is_taken_over(tmp_path):
    folder = tmp_path / "run"
    words = [sys.executable, "-c", HOLDER, str(folder)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        said = (folder / FOLDER_LOCK).read_text()
        assert said == f"process {other.pid} on {socket.gethostname()}\n"
        with (
            pytest.raises(UsageError, match=f"in use by process {other.pid}"),
            hold_folder(folder, UsageError),
        ):
            pytest.fail("two processes hold it")
        other.kill()
    with hold_folder(folder, UsageError):
        assert str(os.getpid()) in (folder / FOLDER_LOCK).read_text()
    assert not list(folder.iterdir())


def test_a_folder_of_another_host_is_refused_with_what_to_do(tmp_path):
    (tmp_path / FOLDER_LOCK).write_text("process 12 on elsewhere\n")
    with (
        pytest.raises(UsageError, match=r"process 12 on elsewhere; if that has ended, delete"),
        hold_folder(tmp_path, UsageError),
    ):
        pytest.fail("it is held")


def test_a_folder_that_nothing_was_put_into_goes_again(tmp_path):
    with pytest.raises(KeyError), hold_folder(tmp_path / "run", UsageError):
        raise KeyError
    assert not (tmp_path / "run").exists()
