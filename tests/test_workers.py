"""Work shared out gives the same as at home, and nobody works on when its boss is gone."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hopping_leg.errors import PhysicsError, UsageError
from hopping_leg.workers import ProcessWorkers, RayWorkers, map_rows

NONE = "Ray is not installed (extra 'cluster')"


def blow_up(number):
    raise PhysicsError(f"Simulation {number} blew up.")


def die_once(mark):
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "lived"


def die(number):
    if number:
        os.kill(os.getpid(), signal.SIGKILL)


def squares(rows):
    return rows**2


def check_contract(workers):
    """Check what holds for all workers: order, errors as raised, rows in parts."""
    assert workers.count == 2
    assert list(workers.map(abs, ((-k,) for k in range(20)))) == list(range(20))
    endless = workers.map(abs, ((-k,) for k in itertools.count()))
    assert [next(endless) for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(PhysicsError) as caught:
        list(workers.map(blow_up, [(7,)]))
    assert str(caught.value) == "Simulation 7 blew up."
    assert type(caught.value) is PhysicsError
    rows = np.arange(10.0).reshape(5, 2)
    np.testing.assert_array_equal(map_rows(workers, squares, rows), rows**2)


def test_processes_give_results_in_order_and_errors_as_they_were_raised():
    with ProcessWorkers(2) as workers:
        check_contract(workers)
    with ProcessWorkers(1) as workers:
        assert list(workers.map(os.getpid, [()])) == [os.getpid()]
    with ProcessWorkers(2) as workers, pytest.raises(UsageError, match="A worker ended early"):
        list(workers.map(die, [(0,), (1,)]))


_KILLED = """
import os, time
from pathlib import Path
from hopping_leg.workers import ProcessWorkers

def work(name):
    Path(name + ".part").write_text(str(os.getpid()))
    Path(name + ".part").rename(name)
    time.sleep(300.0)

if __name__ == "__main__":
    with ProcessWorkers(2) as workers:
        list(workers.map(work, [("first",), ("second",)]))
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_processes_end_with_who_began_them(tmp_path, how):
    (tmp_path / "script.py").write_text(_KILLED)
    words = [sys.executable, "script.py"]
    process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL)
    marks = [tmp_path / "first", tmp_path / "second"]
    wait_for(lambda: all(mark.exists() for mark in marks))
    begun = [mark.read_text() for mark in marks]
    process.send_signal(how)
    process.wait(60)
    wait_for(lambda: not any(Path(f"/proc/{child}/cmdline").exists() for child in begun))


def wait_for(happened):
    deadline = time.monotonic() + 120
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.slow
def test_a_cluster_of_two_machines_does_the_same_and_a_worker_that_dies_begins_again(tmp_path):
    ray = pytest.importorskip("ray", reason=NONE)
    from ray.cluster_utils import Cluster

    ray.shutdown()
    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    machines.add_node(num_cpus=1)
    try:
        check_contract(RayWorkers(machines.address))
        assert list(RayWorkers().map(die_once, [(tmp_path / "mark",)])) == ["lived"]
    finally:
        ray.shutdown()
        machines.shutdown()


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1"])
def test_without_a_cluster_or_ray_there_is_a_sentence_at_once(address, monkeypatch):
    ray = pytest.importorskip("ray", reason=NONE)
    ray.shutdown()
    with pytest.raises(UsageError, match=rf"no Ray cluster at {address}: .*; start one"):
        RayWorkers(address)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r"hopping-leg\[cluster\]"):
        RayWorkers()
