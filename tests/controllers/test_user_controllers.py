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
class Leg:
    def __init__(self, robot, rate):
        self.ticks = 0
    def get_control_output(self, {arguments}):
        self.ticks += 1
        return {answer}
"""


def written(path, text, **parts):
    for name, value in parts.items():
        text = text.replace(f"{{{name}}}", value)
    path.write_text(text)
    return path


def acted(path, name, count=3):
    controller = load_controller(f"{path}:{name}", ROBOT)
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
    path = written(tmp_path / "mine.py", BATCHED, answer="np.full((self.count, 2), self.rate)")
    controller = load_controller(f"{path}:Held", ROBOT, rate=100.0)
    controller.reset(2)
    np.testing.assert_array_equal(controller.act(measurement(2)), np.full((2, 2), 100.0))
    assert controller.internals() == {}
    monkeypatch.syspath_prepend(tmp_path)
    np.testing.assert_array_equal(acted("mine", "Held"), np.full((3, 2), 200.0))


ARGUMENTS = "meas_pos, meas_vel, meas_tau, meas_time"


@pytest.mark.parametrize(
    ("answer", "expected"),
    [("meas_tau + meas_pos", "q"), ("[self.desired_height, meas_time]", "command")],
)
def test_a_single_leg_gets_joints_time_and_command(tmp_path, answer, expected):
    path = written(tmp_path / "leg.py", SINGLE, arguments=ARGUMENTS, answer=answer)
    seen = getattr(measurement(3), expected)[:, 0]
    given = np.stack([seen, np.zeros(3)], axis=1) if expected == "command" else seen
    np.testing.assert_array_equal(acted(path, "Leg"), given)


def test_single_legs_share_no_state_and_are_made_anew_by_reset(tmp_path):
    answer = "[self.ticks, meas_time]"
    path = written(tmp_path / "leg.py", SINGLE, arguments=ARGUMENTS, answer=answer)
    controller = load_controller(f"{path}:Leg", ROBOT)
    for _ in range(2):
        controller.reset(2)
        first, second = (controller.act(measurement(2)) for _ in range(2))
        np.testing.assert_array_equal(first, [[1, 0]] * 2)
        np.testing.assert_allclose(second, [[2, 0.005]] * 2)


@pytest.mark.parametrize(
    ("arguments", "answer", "says"),
    [
        (None, "np.zeros((self.count, 3))", r"finite torques.*\(3, 3\)"),
        (None, "np.full((self.count, 2), np.nan)", "finite torques.*nan"),
        (None, "1 / 0", r"ZeroDivisionError: division by zero \(mine.py, line 9\)"),
        (ARGUMENTS, "[float('inf'), 0.0]", "finite torques"),
        ("a, b, c, d, e", "[0, 0]", "missing 1 required positional argument"),
    ],
)
def test_wrong_answers_are_stopped_by_name(tmp_path, arguments, answer, says):
    text, name = (SINGLE, "Leg") if arguments else (BATCHED, "Held")
    path = written(tmp_path / "mine.py", text, arguments=arguments or "", answer=answer)
    with pytest.raises(ControllerError, match=says) as caught:
        acted(path, name)
    assert f"mine.py:{name}" in str(caught.value)


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
    text = BATCHED + "    def internals(self):\n        return {'height_m': 9.0, 'mine': 1.0}\n"
    path = written(tmp_path / "mine.py", text, answer="np.zeros((self.count, 2))")
    controller = load_controller(f"{path}:Held", ROBOT)
    run = rollout(controller, RolloutConfig(ROBOT, threads=1), np.full((3, 1), 0.3), seed=0)
    assert run.data["height_m"].max() < 1
    assert (run.data["mine"] == 1).all()


def test_an_edited_file_is_another_controller(tmp_path):
    path = written(tmp_path / "mine.py", BATCHED, answer="np.zeros((self.count, 2))")
    before, same = (load_controller(f"{path}:Held", ROBOT).digest for _ in range(2))
    written(path, BATCHED, answer="np.ones((self.count, 2))")
    assert before == same != load_controller(f"{path}:Held", ROBOT).digest
