"""What a verb says to do next works as it stands there, whatever the files are called."""

import dataclasses
import importlib
import shlex
import shutil
from pathlib import Path

import pytest

from hopping_leg.cli import main
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import ROBOT_FILE, load_policy, robot_of
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from tests.cli.emulated import put_behind
from tests.doc_pages import ROOT

ROBOT = "my leg's.toml"
SHORT = {
    "evaluate": ["--seeds", "1", "--commands", "0.3", "--floor", "soft", "--no-video"],
    "identify": ["--parameters", "thigh.inertia", "shank.inertia", "knee.friction"],
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hopping_leg.evaluate.trials.FIXED_SECONDS", 3.0)
    monkeypatch.setattr("hopping_leg.evaluate.trials.STEP_SECONDS", 2.0)
    shutil.copy(ROOT / "examples/my_leg.toml", ROBOT)


@pytest.fixture
def run(capsys):
    """Return a function that runs `hop` and returns what it says to do next."""

    def call(*words):
        assert main([*map(str, words)]) == 0
        said = capsys.readouterr().out.partition("Next:\n")[2].splitlines()
        return [shlex.split(line) for line in said if line.startswith("  hop ")]

    return call


def parse(words, monkeypatch):
    """Check the options of a command, and that the files that it names exist."""
    module, seen = importlib.import_module(f"hopping_leg.cli.{words[1]}"), []

    def note(args):
        seen.append(args)

    note.__annotations__ = module.run.__annotations__
    with monkeypatch.context() as patch:
        patch.setattr(module, "run", note)
        assert main(words[1:]) == 0, words
    assert seen
    files = [word for word in words if word.endswith((".toml", ".onnx", ".parquet"))]
    assert all(Path(file).exists() for file in files), words
    if "--robot" in words:
        load_robot(words[words.index("--robot") + 1])


def shortened(words):
    return [*words[1:], *SHORT.get(words[1], [])]


def test_from_a_urdf_to_an_evaluation(run, monkeypatch):
    shutil.copy(ROOT / "examples/leg.urdf", "a leg.urdf")
    check, view, evaluate = run("robots", "import", "a leg.urdf", "--motor", "ak80-9")
    assert run(*check[1:]) == []
    parse(view, monkeypatch)
    assert evaluate[evaluate.index("--robot") + 1] == "a leg.toml"
    parse(evaluate, monkeypatch)


def test_from_an_excitation_to_an_identified_leg(run, monkeypatch):
    out = "an excitation.parquet"
    (record,) = run("record", "multisine", "--duration", "10", "--robot", ROBOT, "--out", out)
    (identify,) = run(*record[1:], "--out", "my recordings")
    check, train = run(*shortened(identify), "--out", "it's mine.toml")
    assert run(*check[1:]) == []
    parse(train, monkeypatch)


@pytest.mark.parametrize("robot", [DEFAULT_ROBOT, ROBOT])
def test_an_emulated_leg_is_driven_by_what_fits_it(run, monkeypatch, robot):
    pytest.importorskip("moteus")
    (deploy,) = run("emulate", "--robot", robot, "--seconds", "0.1", "--no-realtime")
    parse(deploy, monkeypatch)
    with monkeypatch.context() as patch:
        put_behind(patch, robot=robot, pose="stand")
        (figures,) = run(*deploy[1:], "--seconds", "0.3", "--yes", "--out", "my runs")
    run(*figures[1:])


def trained(folder, robot):
    """Leave what a training on a robot does, but for its time."""
    from hopping_leg.rl.onnx_export import with_card
    from hopping_leg.rl.run_folder import write_robot

    policy = load_policy("fast")
    card = dataclasses.replace(policy.card, robot=robot.name, robot_digest=robot.digest)
    folder.mkdir(parents=True)
    (folder / "policy.onnx").write_bytes(with_card(policy.content, card))
    write_robot(folder, robot)
    return folder / "policy.onnx"


def test_a_policy_is_judged_on_the_robot_that_lies_beside_it(run, capsys):
    pytest.importorskip("onnx")
    robot = load_robot(ROBOT)
    file = trained(Path("runs/my run"), robot)
    beside = str(file.with_name(ROBOT_FILE))
    assert load_robot(beside) == robot
    for named in (str(file), f"mine={file}", "runs/*/policy.onnx"):
        assert robot_of([named]) == beside
    run(*shortened(["hop", "evaluate", str(file)]))
    main(["evaluate", str(file), "--robot", "legv2", *SHORT["evaluate"]])
    said = capsys.readouterr().out
    assert said.index("was trained on robot 'my-leg'") < said.index("soft floor")
    file.with_name(ROBOT_FILE).unlink()
    assert robot_of([str(file)]) == DEFAULT_ROBOT


@pytest.mark.slow
def test_what_a_training_leaves_names_itself(run, monkeypatch):
    pytest.importorskip("torch")
    from tests.rl.learners import try_briefly

    try_briefly(monkeypatch)
    words = ["--steps", "1", "--heights", "0.28", "0.32", "--out", "runs/my run"]
    evaluate, view = run("train", "--recipe", "fast", "--robot", ROBOT, *words)
    run(*shortened(evaluate))
    parse(view, monkeypatch)
    card = Path("runs/my run/model_card.md").read_text()
    assert "`hop evaluate policy.onnx`" in card
    assert "for robot my-leg, `robot.toml` in this folder" in card
    (command,) = (line.strip() for line in card.splitlines() if line.startswith("    hop train"))
    parse(shlex.split(command), monkeypatch)
    assert isinstance(load_policy("runs/my run/policy.onnx"), Policy)


def test_a_robot_file_is_no_controller_and_is_said_to_be_none(capsys):
    for words in (["evaluate", ROBOT], ["view", ROBOT, "--no-browser", "--seconds", "0"]):
        assert main(words) == 2
        assert "is a robot file, no controller; give it with --robot" in capsys.readouterr().err
