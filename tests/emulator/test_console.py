import moteus
import pytest

from tests.emulator.bench import Bench


@pytest.fixture
def bench():
    return Bench()


def console(bench, *lines):
    """Send lines through the client's stream; return the answers."""

    async def talk():
        stream = moteus.Stream(bench.drives[0], use_flow_control=False)
        await stream.write_message(b"tel stop")
        await stream.flush_read(timeout=0.02)
        return [
            await stream.command(line.encode(), allow_any_response=any_) for line, any_ in asked
        ]

    asked = [(line, line.startswith("conf get")) for line in lines]
    return [answer.decode() for answer in bench.run(talk())]


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
    ["conf set servo.nonsense 1", "conf set id.id x", "hello"],
)
def test_nonsense_is_an_error_that_the_client_raises(bench, line):
    with pytest.raises(moteus.moteus.CommandError, match="ERR"):
        console(bench, line)
