import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hopping_leg.cli import main


def test_it_names_the_terminal_and_ends_with_ctrl_c(tmp_path):
    link = tmp_path / "leg"
    words = [sys.executable, "-m", "hopping_leg.cli", "emulate", "--robot", "legv1"]
    pipe = subprocess.PIPE
    process = subprocess.Popen([*words, "--link", link], stdout=pipe, stderr=pipe, text=True)
    try:
        first = process.stdout.readline()
        assert first == f"Drives 1 and 2 of legv1 behind {link}\n"
        assert link.resolve().parent == Path("/dev/pts")
        assert f"--transport {link}" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "The emulator ended" in rest
    assert not errors
    assert not link.is_symlink()


def test_it_tells_faults_and_changes_of_mode(tmp_path, capsys):
    script = tmp_path / "faults.toml"
    script.write_text('[[fault]]\nkind = "encoder_jump"\nsince = "start"\nat = 0.1\ndrive = "hip"')
    assert main(["emulate", "--faults", str(script), "--seconds", "0.3"]) == 0
    assert "fault: a joint's angle is wrong from now on (hip)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--robot", "doublependulum"], "cannot hop"),
        (["--start-pose", "1,2,3"], "There is no pose '1,2,3'"),
        (["--faults", "none.toml"], "no fault script none.toml"),
        (["--seed", "-1"], "--seed is -1"),
        (["--channel", "x"], "A channel is for CAN buses"),
    ],
)
def test_wrong_input_is_one_sentence(refused, words, sentence):
    refused(["emulate", "--seconds", "0", *words], sentence)
