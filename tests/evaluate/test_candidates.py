from types import SimpleNamespace

import pytest

from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.evaluate import candidates
from hopping_leg.evaluate.candidates import load_candidates


class FakePolicy:
    def __init__(self, digest):
        self.card = SimpleNamespace(
            command_low=0.2, command_high=0.4, recipe="fast", robot="other", robot_digest=digest
        )

    def check_robot(self, robot, rate, strict):
        assert not strict


def test_a_name_that_does_not_exist_is_answered_with_those_that_do(robot):
    with pytest.raises(UsageError, match="energy-shaping"):
        load_candidates(["enrgy-shaping"], robot, 200.0)


def test_a_pattern_without_a_match_is_an_error(robot, tmp_path):
    with pytest.raises(PolicyError, match="No policy file matches"):
        load_candidates([str(tmp_path / "*.onnx")], robot, 200.0)


def test_a_pattern_becomes_a_group_with_ranges_and_warnings(robot, tmp_path, monkeypatch):
    for name in ("a.onnx", "b.onnx"):
        (tmp_path / name).touch()
    monkeypatch.setattr(candidates, "Policy", FakePolicy)
    monkeypatch.setattr(candidates, "load_controller", lambda *_, **__: FakePolicy("0" * 16))
    found = load_candidates([str(tmp_path / "*.onnx")], robot, 200.0)
    assert [c.label for c in found] == [str(tmp_path / "a.onnx"), str(tmp_path / "b.onnx")]
    assert {c.group for c in found} == {"fast from files"}
    assert found[0].command_range == (0.2, 0.4)
    assert "was trained on robot 'other'" in found[0].notes[0]
