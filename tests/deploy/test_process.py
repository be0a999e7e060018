"""`hop deploy` as a process of its own against an emulator in real time: order, not speed.

On a busy computer the supervisor may stop a run by itself; nothing here minds.
"""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from studies.fault_campaign.emulator_process import EmulatorProcess

from hopping_leg.cli import main
from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.supervisor import State
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.errors import TraceError
from hopping_leg.flight_recording import recover
from hopping_leg.trace import Trace

pytestmark = pytest.mark.slow
BEGUN = 40  # Rows in the black box after which a run counts as begun


@pytest.fixture
def emulator():
    with EmulatorProcess(EmulatorConfig(robot="legv2-paper")) as running:
        yield running


def deploy(emulator, folder, *, controller="energy-shaping", stdin=subprocess.DEVNULL):
    words = ["deploy", controller, "--transport", str(emulator.path), "--seconds", "20"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hopping_leg.cli", *words, "--yes", "--out", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=stdin,
        text=True,
    )
    for _ in range(3000):
        time.sleep(0.02)
        assert process.poll() is None, process.communicate()
        for box in folder.glob("*.blackbox"):
            try:
                if recover(box).table.height > BEGUN:
                    return process, box
            except TraceError:
                continue
    raise AssertionError("the run did not begin")


def test_a_killed_host_leaves_its_record_and_drives_that_brake(emulator, tmp_path):
    process, box = deploy(emulator, tmp_path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    time.sleep(0.5)
    assert DriveMode.POSITION not in emulator.state().modes
    rows = recover(box).table.height
    assert rows > BEGUN
    assert main(["report", str(box), "--out", str(tmp_path / "figures")]) == 0
    assert Trace.load(box.with_suffix(".parquet")).table.height == rows


@pytest.mark.parametrize("name", ["", "SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP"])
def test_a_host_that_gets_a_signal_or_whose_input_ends_brakes_stops_and_says_so(
    emulator, tmp_path, name
):
    process, box = deploy(emulator, tmp_path, stdin=subprocess.DEVNULL if name else subprocess.PIPE)
    if name:
        process.send_signal(getattr(signal, name))
    out, error = process.communicate(timeout=60)
    assert process.returncode in (0, 2)
    assert "Traceback" not in error
    assert "Wrote" in out
    assert not box.exists()
    states = Trace.load(box.with_suffix(".parquet")).column("state")
    assert (np.diff(states) >= 0).all()
    assert states[-1] == State.STOPPED
    time.sleep(0.2)
    assert emulator.state().modes == (0, 0)


STUCK = """
import time
class Stuck:
    def __init__(self, robot, rate): self.begun = None
    def reset(self, count): pass
    def act(self, measurement):
        self.begun = self.begun or time.monotonic()
        while {condition}: pass
        return [[0.0, 0.0]]
"""


@pytest.mark.parametrize("condition", ["True", "time.monotonic() < self.begun + 0.3"])
def test_a_second_signal_ends_the_process_within_a_second(tmp_path, condition):
    (tmp_path / "stuck.py").write_text(STUCK.format(condition=condition))
    error, stuck = "was stopped", f"{tmp_path / 'stuck.py'}:Stuck"
    while "was stopped" in error:  # by a busy computer, before it hung
        with EmulatorProcess(EmulatorConfig(robot="legv2-paper")) as emulator:
            process, box = deploy(emulator, tmp_path / "run", controller=stuck)
            time.sleep(2.6)  # it has risen, and hops
            process.send_signal(signal.SIGTERM)
            time.sleep(0.1)
            began = time.monotonic()
            process.send_signal(signal.SIGTERM)
            _, error = process.communicate(timeout=60)
            assert time.monotonic() - began < 1.5
            time.sleep(0.3)
            assert DriveMode.POSITION not in emulator.state().modes
    assert (process.returncode, "Traceback" in error) == (2, False), error
    assert recover(box).table.height > BEGUN
