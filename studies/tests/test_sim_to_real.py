"""Sim-to-real: what its methods know of a twin, what is done once, how hops are judged."""

import dataclasses
import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from tests.controllers.test_rollout import Constant

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.energy_shaping.gains import load_gains
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import RobotError, UsageError
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot, load_tree, robot_text
from hopping_leg.sim import NO_NOISE, Measurement
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES

pytest.importorskip("torch")
from studies import shared
from studies.sim_to_real import steps
from studies.sim_to_real.chain import Chain, Experiment
from studies.sim_to_real.run import Options
from studies.sim_to_real.twins import PLAY, disturbance_of, find_twins, simulated
from studies.tests.test_energy_shaping import scored_by_exponent


def chain(folder, methods=("identified", "cad"), **options):
    """Return a chain of two twins to ask things of."""
    return Chain(Experiment(("2",), methods, folder=folder, **options))


def main(words):
    return shared.main("sim_to_real", Options, ["transfer", *words])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--methods", "cda"], "Did you mean 'cad'"),
        (["--twins", "0"], "1 or more"),
        (["--twins", "legv2"], "extends no robot"),
        (["--jobs", "0"], "--jobs is 0"),
        (["--seconds", "1"], "--seconds is 1"),
        (["--recipe", "pape"], "Did you mean 'paper'"),
    ],
)
def test_bad_options_are_a_sentence_before_anything_runs(tmp_path, capsys, words, says):
    assert main(["--folder", str(tmp_path), *words]) == 2
    assert says in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if path.suffix != ".toml" and path.is_file()]


@pytest.mark.slow
def test_a_study_is_finished_once_and_grows(tmp_path):
    folder, file = tmp_path / "study", tmp_path / "out.json"
    words = ["--folder", str(folder), "--json", str(file)]
    words += ["--steps", "1", "--repeats", "1", "--commands", "0.3"]
    assert main([*words, "--twins", "1", "--methods", "truth"]) == 0
    first = json.loads(file.read_text())
    assert first["command"].startswith("python -m studies.sim_to_real transfer --folder")
    (policy,) = folder.glob("training/twin-0-truth-seed0-*/policy.onnx")
    made = policy.stat().st_mtime_ns
    assert main([*words, "--twins", "2", "--methods", "truth", "cad", "--jobs", "2"]) == 0
    second = json.loads(file.read_text())
    assert policy.stat().st_mtime_ns == made
    assert second["trials"][0] == first["trials"][0]
    found = {(r["method"], r["twin"]) for r in second["trials"]}
    shaped = ["energy-shaping", "energy-shaping-tuned"]
    assert found == set(product(("truth", "cad", *shaped), ("twin-0", "twin-1")))
    assert len(second["trainings"]) == 3
    assert [row["method"] for row in second["comparison"]] == ["cad", *shaped]
    words[words.index("--steps") + 1] = "20000"
    assert main([*words, "--twins", "1", "--methods", "truth"]) == 0
    assert len(list(folder.glob("training/twin-0-truth-seed0-*/policy.onnx"))) == 2


def test_no_method_but_the_truth_trains_on_what_the_twin_alone_knows(tmp_path):
    one = chain(tmp_path, ("cad", "table-1", "randomised", "truth"))
    twin = one.twins[0]
    trained = [method for method in one.methods if not method.untrained]
    jobs = {method.name: one._training(twin, method, 0) for method in trained}
    recipes, robots, folders = (
        {name: job[at] for name, job in jobs.items()} for at in (3, 4, 6)
    )  # fmt: skip
    for name in ("cad", "randomised"):
        assert robots[name] == load_robot("legv2")
    assert robots["table-1"] == load_robot("legv2-paper")
    assert recipes["cad"].task.randomised == ()
    assert recipes["randomised"].task.randomised == IDENTIFIABLE_RANGES
    truth = robots["truth"]
    assert truth.reality == truth.reality.in_training
    assert twin.robot.reality != twin.robot.reality.in_training
    assert truth.reality.latency.command == twin.robot.reality.latency.command
    assert disturbance_of(twin.robot) == NO_NOISE
    assert disturbance_of(load_robot("legv2")).torque_noise > 0
    assert truth.rail == twin.robot.rail
    assert len(set(folders.values())) == len(folders)


def test_a_belt_is_trained_on_as_fitted_and_noise_comes_when_asked(tmp_path):
    one = chain(tmp_path, ("identified", "identified-belt", "two-pass"), disturbance="on")
    assert disturbance_of(load_robot("legv2"), "off") == NO_NOISE
    assert one.about()["twins"][0]["paper_disturbance"]
    assert len({one.source(one.twins[0], method) for method in one.methods[:3]}) == 3
    knee = simulated(one.twins[0].source, belt=True).reality.knee
    assert knee.stiffness == one.twins[0].robot.reality.knee.stiffness
    assert knee.backlash == PLAY["backlash"]


def test_what_does_not_depend_on_twin_or_seed_is_done_once(tmp_path):
    one = chain(tmp_path, ("truth", "cad"), seeds=(0, 1))
    trained = {one._training(*run)[0].stem for run in one._runs() if not run[1].untrained}
    assert sorted(name.rpartition("-")[0] for name in trained) == [
        "legv2-seed0", "legv2-seed1", "twin-0-truth-seed0", "twin-0-truth-seed1",
        "twin-1-truth-seed0", "twin-1-truth-seed1",
    ]  # fmt: skip
    shaped = [(twin.name, seed) for twin, method, seed in one._runs() if method.untrained]
    assert shaped == 2 * [("twin-0", 0), ("twin-1", 0)]


@pytest.mark.slow
def test_a_twin_is_recorded_to_its_stops_and_identified_from_that_alone(tmp_path):
    one = Chain(Experiment(("1",), ("identified",), folder=tmp_path, seconds=30.0))
    (fit,) = one.identify()
    assert (fit["method"], fit["twin"]) == ("identified", "twin-0")
    recording = load_recording(tmp_path / "recordings" / "twin-0-rail.parquet")
    assert recording.array("position").min() < one.twins[0].robot.knee.stop_lower
    truth = {name: true for name, (_, true) in fit["parameters"].items()}
    assert truth["hip.friction"] == one.twins[0].robot.hip.friction
    assert truth["drive.delay"] == one.twins[0].robot.reality.latency.command
    found = load_robot(one.source(one.twins[0], one.methods[0]))
    assert found.hip.friction != load_robot("legv2").hip.friction
    assert one.identify() == [fit]


def test_gains_are_tuned_on_what_was_identified_and_hop_on_the_twin(tmp_path, monkeypatch):
    scored_by_exponent(monkeypatch)
    monkeypatch.setattr(steps, "TUNE", dataclasses.replace(steps.TUNE, generations=3))
    one = chain(tmp_path, ("energy-shaping", "energy-shaping-identified"))
    for twin in one.twins:
        file = Path(one.source(twin, one.methods[1]))
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(robot_text(load_tree("legv2") | {"name": "found"}))
    assert one.train() == []
    twin, method = one.twins[1], one.methods[1]
    file = one._tuning(twin, method)[-1] / "gains.toml"
    tuned = steps.load(file, one.source(twin, method))
    shipped = steps.load("energy-shaping", "legv2")
    assert load_robot(load_gains(str(file)).robot).reality.knee.backlash == PLAY["backlash"]
    assert tuned.gains != shipped.gains
    assert (tuned.robot.name, shipped.robot.name) == ("found", "legv2")


def test_twins_are_drawn_or_brought(tmp_path):
    one, again = (find_twins(["2"], tmp_path) for _ in range(2))
    assert one == again
    assert one[0].believed == "legv2"
    assert one[0].robot.digest != one[1].robot.digest
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nextends = "legv2-paper"\n')
    mine, shipped = find_twins([str(file), "twin"], tmp_path)
    assert (mine.name, mine.believed, shipped.name) == ("mine", "legv2-paper", "twin")
    for words in (["0"], ["legv2"], [str(file), str(file)], ["legv9"]):
        with pytest.raises((UsageError, RobotError)):
            find_twins(words, tmp_path)


def test_a_leg_that_never_hops_errs_by_the_distance_from_standing():
    (row,) = steps.hops_of(Constant([0.0, 0.0]), load_robot("legv2-paper"), (0.3,), 1)
    standing = RolloutConfig(load_robot("legv2-paper")).standing_length + 0.01
    assert row["motionless"]
    assert row["median_error_m"] == pytest.approx(standing - 0.3, abs=1e-3)
    assert row["median_abs_error_m"] == -row["median_error_m"]
    assert json.dumps(row)


def test_a_policy_is_asked_for_the_nearest_height_of_its_training():
    policy, asked = load_policy("fast"), []
    act = policy.act
    policy.act = lambda seen: asked.append(seen.command) or act(seen)
    within = steps.WithinRange(policy, load_robot("legv2"))
    within.reset(2)
    zeros, command = np.zeros((2, 3, 2)), np.array([[0.3] * 3, [9.0] * 3])
    within.act(Measurement(zeros, zeros, command, np.zeros((2, 3))))
    np.testing.assert_array_equal(asked[0][:, 0], [0.3, policy.card.command_high])
