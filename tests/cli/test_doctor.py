import pytest

from hopping_leg.cli.doctor import missing
from tests.extras import TRAINING, run_without

OPTIONAL = [*TRAINING, "ray", "moteus", "can", "serial", "viser", "playwright", "mcap", "mcap_ros2"]
HARDWARE = "pip install 'hopping-leg[hardware]'"


@pytest.mark.parametrize(
    ("words", "exit_code", "said"),
    [
        (["doctor"], 0, "compiled code: "),
        (["emulate", "--kinds"], 0, "late_reply"),
        (["train"], 2, "pip install 'hopping-leg[train]'"),
        (["emulate"], 2, HARDWARE),
        (["doctor", "--transport", "/dev/null"], 2, HARDWARE),
        (["deploy", "energy-shaping", "--transport", "/dev/null"], 2, HARDWARE),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_core_says_what_there_is_and_which_extra_a_verb_needs(words, exit_code, said):
    code = f"from hopping_leg.cli import main\nraise SystemExit(main({words!r}))"
    done = run_without(OPTIONAL, code)
    assert done.returncode == exit_code, done.stderr
    assert said in (done.stderr if exit_code else done.stdout)
    assert "Traceback" not in done.stderr


def test_what_a_system_cannot_do_is_said_where_it_cannot():
    assert [len(missing(system)) for system in ("linux", "darwin", "win32")] == [0, 1, 2]
