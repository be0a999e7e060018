"""What one process holds at a time: others are told who has it."""

import os
import subprocess
import tty

import pytest

from hopping_leg.errors import UsageError
from hopping_leg.locks import FOLDER_LOCK, DeviceLock, hold_folder, named_lock


def test_a_second_one_is_refused_until_the_first_gives_it_back():
    first = named_lock("test-a/b", "the bus", UsageError)
    with pytest.raises(UsageError, match="the bus is in use by"):
        named_lock("test-a/b", "the bus", UsageError)
    named_lock("test-a/c", "another bus", UsageError).release()
    first.release()
    first.release()
    named_lock("test-a/b", "the bus", UsageError).release()


def test_a_terminal_that_any_other_program_has_open_is_refused_with_its_name(tmp_path):
    master, slave = os.openpty()
    tty.setraw(slave)
    path = tmp_path / "link"
    path.symlink_to(os.ttyname(slave))
    DeviceLock(path, UsageError).close()
    waits = ["sh", "-c", "echo; read _"]
    with subprocess.Popen(waits, stdin=slave, stdout=subprocess.PIPE) as other:
        other.stdout.readline()  # its name is known once it runs, not once it is started
        who = rf"in use by process {other.pid} \(sh -c echo; read _\)"
        with pytest.raises(UsageError, match=who):
            DeviceLock(path, UsageError)
        other.kill()
    DeviceLock(path, UsageError).close()
    os.close(master)
    os.close(slave)


def test_a_folder_belongs_to_one_until_it_is_given_back(tmp_path):
    folder = tmp_path / "run"
    with hold_folder(folder, UsageError):
        second = hold_folder(folder, UsageError)
        with pytest.raises(UsageError, match="in use by another process"), second:
            pytest.fail("two hold it")
    with hold_folder(folder, UsageError):
        assert (folder / FOLDER_LOCK).exists()
