"""A Python class enters wherever a controller is named; what is wrong with it is one sentence."""

from pathlib import Path

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import ControllerError
from hopping_leg.robot import load_robot
from tests.controllers.measurements import hops_of, measurement

ROBOT = load_robot("legv2-paper")
BOUNCER = Path(__file__).parents[2] / "examples" / "bouncer.py"

BATCHED = """
import numpy as np
class Held:
    def __init__(self, robot, rate):
        self.rate = rate
    def reset(self, count):
        self.count = count
    def act(self, measurement):
        return {answer}
"""

SINGLE = """
class Held:
    def __init__(self, robot, rate):
        self.ticks = 0
    def get_control_output(self, {arguments}):
        self.ticks += 1
        return {answer}
"""
ARGUMENTS = "meas_pos, meas_vel, meas_tau, meas_time"


def written(folder, text, answer, arguments=ARGUMENTS):
    """Write a class to a file; return what a controller of it is called."""
    (folder / "mine.py").write_text(text.format(answer=answer, arguments=arguments))
    return f"{folder / 'mine.py'}:Held"


def acted(name, count=3, **options):
    controller = load_controller(name, ROBOT, **options)
    controller.reset(count)
    return controller.act(measurement(count))


def test_example_hops_with_every_leg_on_its_own():
    assert len(BOUNCER.read_text().splitlines()) <= 40
    controller = load_controller(f"{BOUNCER}:Bouncer", ROBOT)
    commands = np.tile([0.30, 0.35], (800, 1))
    run = rollout(controller, RolloutConfig(ROBOT, threads=1), commands, seed=3)
    low, high = (hops.apex[hops.tick > 200] for hops in (hops_of(run, 0), hops_of(run, 1)))
    assert min(len(low), len(high)) > 5
    assert np.median(high) > np.median(low) + 0.02
    assert run.header["controller"] == "Bouncer"


def test_batched_class_gets_robot_and_rate_and_may_be_a_modules(tmp_path, monkeypatch):
    name = written(tmp_path, BATCHED, "np.full((self.count, 2), self.rate)")
    np.testing.assert_array_equal(acted(name, rate=100.0), np.full((3, 2), 100.0))
    monkeypatch.syspath_prepend(tmp_path)
    np.testing.assert_array_equal(acted("mine:Held"), np.full((3, 2), 200.0))


@pytest.mark.parametrize(
    ("answer", "expected"),
    [("meas_tau + meas_pos", "q"), ("[self.desired_height, meas_time]", "command")],
)
def test_a_single_leg_gets_joints_time_and_command(tmp_path, answer, expected):
    seen = getattr(measurement(3), expected)[:, 0]
    given = np.stack([seen, np.zeros(3)], axis=1) if expected == "command" else seen
    np.testing.assert_array_equal(acted(written(tmp_path, SINGLE, answer)), given)


def test_single_legs_share_no_state_and_are_made_anew_by_reset(tmp_path):
    controller = load_controller(written(tmp_path, SINGLE, "[self.ticks, meas_time]"), ROBOT)
    for _ in range(2):
        controller.reset(2)
        first, second = (controller.act(measurement(2)) for _ in range(2))
        np.testing.assert_array_equal(first, [[1, 0]] * 2)
        np.testing.assert_allclose(second, [[2, 0.005]] * 2)


@pytest.mark.parametrize(
    ("text", "arguments", "answer", "says"),
    [
        (BATCHED, "", "np.zeros((self.count, 3))", r"finite torques.*\(3, 3\)"),
        (BATCHED, "", "np.full((self.count, 2), np.nan)", "finite torques.*nan"),
        (BATCHED, "", "1 / 0", r"ZeroDivisionError: division by zero \(mine.py, line 9\)"),
        (SINGLE, ARGUMENTS, "[float('inf'), 0.0]", "finite torques"),
        (SINGLE, "a, b, c, d, e", "[0, 0]", "missing 1 required positional argument"),
    ],
)
def test_wrong_answers_are_stopped_by_name(tmp_path, text, arguments, answer, says):
    with pytest.raises(ControllerError, match=says) as caught:
        acted(written(tmp_path, text, answer, arguments))
    assert "mine.py:Held" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "name", "says"),
    [
        (None, "none.py:Leg", "No such file"),
        ("class Leg: pass", "mine.py:Log", "no class 'Log'. Did you mean 'Leg'"),
        ("class Leg: pass", "mine.py", "Available: Leg. Write .*mine.py:CLASS"),
        ("class Leg: pass", "mine.py:Leg", r"Leg\(robot, rate=200\)"),
        ("def make(robot, rate): return 3", "mine.py:make", "has the methods 'reset' and 'act'"),
        ("import nowhere", "mine.py:Leg", r"No module named 'nowhere' \(mine.py, line 1\)"),
        ("class Leg(", "mine.py:Leg", "could not be imported: SyntaxError"),
    ],
)
def test_what_cannot_be_loaded_is_one_sentence(tmp_path, content, name, says):
    if content is not None:
        (tmp_path / "mine.py").write_text(content)
    with pytest.raises(ControllerError, match=says):
        load_controller(tmp_path / name, ROBOT)


def test_what_is_recorded_of_a_controller_does_not_replace_what_is_of_the_leg(tmp_path):
    text = BATCHED + "    def internals(self):\n        return dict(height_m=9.0, mine=1.0)\n"
    controller = load_controller(written(tmp_path, text, "np.zeros((self.count, 2))"), ROBOT)
    run = rollout(controller, RolloutConfig(ROBOT, threads=1), np.full((3, 1), 0.3), seed=0)
    assert run.data["height_m"].max() < 1
    assert (run.data["mine"] == 1).all()


def test_an_edited_file_is_another_controller(tmp_path):
    name = written(tmp_path, BATCHED, "np.zeros((self.count, 2))")
    before, same = (load_controller(name, ROBOT).digest for _ in range(2))
    written(tmp_path, BATCHED, "np.ones((self.count, 2))")
    assert before == same != load_controller(name, ROBOT).digest
