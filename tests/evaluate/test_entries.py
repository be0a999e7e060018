from pathlib import Path
from types import SimpleNamespace

import pytest

from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.evaluate import entries
from hopping_leg.evaluate.entries import load_entries


class FakePolicy:
    def __init__(self, seed):
        made = {"recipe": "fast", "robot": "other", "robot_digest": "0" * 16, "seed": seed}
        self.card = SimpleNamespace(command_low=0.2, command_high=0.4, **made)

    stranger = Policy.stranger


def test_what_does_not_exist_is_refused(robot, tmp_path):
    with pytest.raises(UsageError, match="energy-shaping"):
        load_entries(["enrgy-shaping"], robot, 200.0)
    with pytest.raises(PolicyError, match="No policy file matches"):
        load_entries([str(tmp_path / "*.onnx")], robot, 200.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two policy files; the training seed is the file's name."""
    for name in ("1.onnx", "2.onnx"):
        (tmp_path / name).touch()
    monkeypatch.setattr(entries, "Policy", FakePolicy)
    monkeypatch.setattr(
        entries, "load_controller", lambda name, *_, **__: FakePolicy(int(Path(name).stem))
    )
    return tmp_path


def test_a_pattern_becomes_a_group_with_ranges_and_warnings(robot, folder):
    found = load_entries([str(folder / "*.onnx")], robot, 200.0)
    assert [c.label for c in found] == [str(folder / "1.onnx"), str(folder / "2.onnx")]
    assert {c.group for c in found} == {"fast, 2 training seeds"}
    assert found[0].command_range == (0.2, 0.4)
    assert "was trained on robot 'other'" in found[0].notes[0]


def test_files_of_one_name_go_by_their_folders(robot, folder):
    for name in ("seed=1", "seed=2"):
        (folder / name).mkdir()
        (folder / name / "1.onnx").touch()
    found = load_entries([str(folder / "seed*" / "1.onnx")], robot, 200.0)
    assert [c.label for c in found] == ["seed=1", "seed=2"]


def test_a_file_can_be_given_a_label(robot, folder):
    [found] = load_entries([f"mine={folder / '1.onnx'}"], robot, 200.0)
    assert found.label == "mine"
    assert found.controller.card.seed == 1
    assert found.notes[0].startswith("mine was trained")
    (folder / "a=1").mkdir()  # a path may hold an equals sign, too
    path = folder / "a=1" / "2.onnx"
    path.touch()
    assert [found.label for found in load_entries([str(path)], robot, 200.0)] == [str(path)]


def test_snapshots_of_one_training_are_no_group(robot, folder):
    (folder / "01.onnx").touch()
    found = load_entries([str(folder / "*.onnx")], robot, 200.0)
    assert [c.group for c in found] == [None] * 3
