import pytest

from tests.emulator.bench import Bench


@pytest.fixture
def bench():
    return Bench()


def console(bench, *lines):
    """Send lines in the client's frames; return the answers."""
    drive, text = bench.drives[0], b""
    for line in lines:
        said = f"{line}\n".encode()
        for begin in range(0, len(said), drive.max_diagnostic_write):
            piece = said[begin : begin + drive.max_diagnostic_write]
            bench.cycle(drive.make_diagnostic_write(piece))
    while (answer := bench.cycle(drive.make_diagnostic_read())[0]).data:
        text += answer.data
    return text.decode().splitlines()


def test_settings_are_read_set_and_kept(bench):
    read, write = "conf get servo.timeout_mode", "conf set servo.timeout_mode 12"
    answers = console(bench, read, write, read)
    assert answers[0] == "15"
    assert answers[2] == "12"
    drive = bench.robot.drives[0]
    drive.boot(0.0)
    assert drive.settings["servo.timeout_mode"] == 15
    console(bench, write, "conf write")
    drive.boot(0.0)
    assert drive.settings["servo.timeout_mode"] == 12


@pytest.mark.parametrize(
    "line",
    ["conf set servo.nonsense 1", "conf get servo.nonsense", "conf set id.id x", "hello"],
)
def test_nonsense_is_an_error(bench, line):
    (answer,) = console(bench, line)
    assert answer.startswith("ERR")
