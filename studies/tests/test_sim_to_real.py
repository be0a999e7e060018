"""The sim-to-real study: what its methods know, its tables, its command line, what it refuses."""

import dataclasses
import json
from pathlib import Path

import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.robot import load_robot, load_tree, robot_text
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES
from studies.energy_shaping.tune import Tune
from studies.sim_to_real.twins import simulated
from studies.tests.test_transfer_tables import trials

pytest.importorskip("torch")
from studies import shared
from studies.sim_to_real import study as study_module
from studies.sim_to_real.run import EFFECTS, Options, best_in_own_simulation, without
from studies.sim_to_real.study import Study, choose_methods, find_twins


def study(folder, methods=("identified", "cad"), **options):
    """Return a small study to ask things of."""
    return Study(folder, find_twins(["2"], folder / "twins"), choose_methods(methods), **options)


def main(words, part="transfer"):
    return shared.main("sim_to_real", Options, [part, *words])


CHEAP = ["--steps", "1", "--repeats", "1", "--commands", "0.3"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--methods", "cda"], "Did you mean 'cad'"),
        (["--twins", "0"], "too few"),
        (["--twins", "legv2"], "extends no robot"),
        (["--jobs", "0"], "--jobs is 0"),
        (["--seconds", "1"], "too short"),
        (["--steps", "0"], "at least 1"),
        (["--recipe", "precis"], "Did you mean 'precise'"),
        (["--recipe", "paper", "--set", "reward.jerks=0"], "Did you mean 'reward.jerk'"),
    ],
)
def test_bad_options_are_a_sentence_before_anything_runs(tmp_path, capsys, words, says):
    assert main(["--folder", str(tmp_path), *words]) == 2
    assert says in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if path.suffix != ".toml" and path.is_file()]


@pytest.mark.slow
def test_a_study_is_finished_once_and_grows(tmp_path, capsys):
    folder, file = tmp_path / "study", tmp_path / "out.json"
    words = ["--folder", str(folder), "--json", str(file), *CHEAP]
    assert main([*words, "--twins", "1", "--methods", "truth"]) == 0
    first = json.loads(file.read_text())
    assert first["command"].startswith(
        "python -m studies.sim_to_real transfer --twins 1 --methods truth --steps 1"
    )
    policy = folder / "training" / "twin-0-truth-seed0" / "policy.onnx"
    made = policy.stat().st_mtime_ns
    assert main([*words, "--twins", "2", "--methods", "truth", "cad", "--jobs", "2"]) == 0
    second = json.loads(file.read_text())
    assert policy.stat().st_mtime_ns == made
    assert second["trials"][0] == first["trials"][0]
    assert {(r["method"], r["twin"]) for r in second["trials"]} == {
        (method, twin)
        for method in ("truth", "cad", "energy-shaping")
        for twin in ("twin-0", "twin-1")
    }
    assert len(list((folder / "training").iterdir())) == 3
    assert [row["method"] for row in second["comparison"]] == ["cad", "energy-shaping"]
    assert "too few for intervals over twins" in second["notes"][0]
    assert not second["twins"][0]["paper_disturbance"]
    assert "truth" in capsys.readouterr().out
    words[words.index("--steps") + 1] = "40000"
    assert main([*words, "--twins", "1", "--methods", "truth"]) == 2
    assert "another options" in capsys.readouterr().err


@pytest.mark.slow
def test_simulations_foretell_without_a_training(tmp_path, capsys):
    folder, file = tmp_path / "study", tmp_path / "out.json"
    words = ["--folder", str(folder), "--json", str(file)]
    words += ["--twins", "2", "--repeats", "1", "--commands", "0.25,0.35"]
    assert main([*words, "--methods", "truth", "cad"], "prediction") == 0
    found = json.loads(file.read_text())
    assert found["command"].startswith("python -m studies.sim_to_real prediction --twins 2")
    told = {row["method"]: row for row in found["methods"] if row["controller"] == "fast"}
    assert told["truth"]["median_abs_error_m"] < told["cad"]["median_abs_error_m"]
    assert set(told["truth"]["errors_m"]) == {"twin-0", "twin-1"}
    assert not (folder / "training").exists()
    assert "foretells" in capsys.readouterr().out
    assert main([*words, "--methods", "randomised"], "prediction") == 2
    assert "none foretells" in capsys.readouterr().err


def test_no_method_but_the_truth_trains_on_what_the_twin_alone_knows(tmp_path):
    names = ("cad", "table-1", "randomised", "truth", "cad-surprises")
    one = study(tmp_path, (*names, "identified", "identified-surprises"))
    twin = one.twins[0]
    trains = {method.name: one.training(twin, method, 0) for method in one.methods}
    for name in ("cad", "randomised", "cad-surprises"):
        assert simulated(trains[name].source) == load_robot("legv2")
    assert simulated(trains["table-1"].source) == load_robot("legv2-paper")
    assert trains["cad"].recipe.task.randomised == ()
    assert trains["randomised"].recipe.task.randomised == IDENTIFIABLE_RANGES
    assert trains["cad-surprises"].recipe.task.randomised == WIDE_RANGES
    truth = simulated(trains["truth"].source)
    assert truth.reality.only_delays
    assert truth.rail == twin.robot.rail
    assert len({train.folder for train in trains.values()}) == len(trains)
    assert trains["identified"].source == trains["identified-surprises"].source
    assert [job.name for job in one.fits()] == [f"identify {t.name}, identified" for t in one.twins]


def test_legs_are_drawn_from_the_intervals_of_the_fit(tmp_path):
    one = study(tmp_path, ("identified-posterior",))
    training = one.trainings()[0]
    told = {"unit": "", "bound_low": 0.0, "bound_high": 2.0}
    rows = [
        {"name": "hip.friction", "interval_low": 0.1, "interval_high": 0.2, **told},
        {"name": "rail.friction", "interval_low": None, "interval_high": None, **told},
        {"name": "drive.delay", "interval_low": 0.0, "interval_high": 0.1, **told},
    ]
    fit = Path(training.source)
    fit.parent.mkdir(parents=True)
    fit.with_suffix(".json").write_text(json.dumps({"parameters": rows}))
    ranges = training.trained.task.randomised
    assert [(r.path, r.low, r.high) for r in ranges] == [
        ("hip.friction", 0.1, 0.2),
        ("rail.friction", 0.0, 2.0),
    ]


def test_a_search_belongs_to_its_fit(tmp_path, monkeypatch):
    one = study(tmp_path, ("identified", "two-pass"), generations=7)
    for fit in one.fits():
        monkeypatch.setattr(type(fit), "_load", lambda self: [])
    by_name = {fit.method: fit.asked for fit in one.fits()}
    assert by_name["identified"]["generations"] is None
    assert (by_name["two-pass"]["search"], by_name["two-pass"]["generations"]) == ("two-pass", 7)


def test_a_study_can_change_the_recipe_but_for_its_steps(tmp_path):
    changes = ("task.fall_penalty=0.7", "steps=3")
    one = study(tmp_path, ["cad"], recipe="paper", changes=changes, steps=5)
    recipe = one.trainings()[0].recipe
    assert recipe.task.fall_penalty == 0.7
    assert recipe.schedule.steps == 5


@pytest.mark.parametrize("effect", EFFECTS)
def test_one_effect_is_taken_away_and_the_rest_stays(tmp_path, effect):
    whole = study(tmp_path, ("identified",)).hops()[0]
    less = without(whole, effect)
    assert less.leg != whole.leg == whole.twin.robot
    assert not less.leg.reality.only_delays
    assert less.file != whole.file
    assert less.policy == whole.policy
    for other in set(EFFECTS) - {effect}:
        assert EFFECTS[other](less.leg.reality) != less.leg.reality
    assert EFFECTS[effect](less.leg.reality) == less.leg.reality


def test_without_all_effects_nothing_is_left(tmp_path):
    reality = study(tmp_path).twins[0].robot.reality
    for take_away in EFFECTS.values():
        reality = take_away(reality)
    periods = reality.hip.ripple_periods, reality.knee.ripple_periods
    assert dataclasses.replace(
        reality,
        hip=dataclasses.replace(reality.hip, ripple_periods=1.0),
        knee=dataclasses.replace(reality.knee, ripple_periods=1.0),
    ).neutral
    assert periods != (1.0, 1.0)


def test_energy_shaping_hops_without_a_training_once_per_twin(tmp_path):
    one = study(tmp_path, ("identified", "energy-shaping"), seeds=(0, 1))
    names = [job.folder.name for job in one.trainings()]
    assert names == [f"twin-{t}-identified-seed{s}" for s in (0, 1) for t in (0, 1)]
    seeds = [(job.twin.name, job.seed) for job in one.hops() if job.policy is None]
    assert seeds == [("twin-0", 0), ("twin-1", 0)]


def test_gains_are_tuned_on_what_was_identified_and_hop_on_the_twin(tmp_path, monkeypatch):
    monkeypatch.setattr(
        study_module,
        "_SEARCH",
        Tune(start="energy-shaping", generations=1, population=4, seconds=3.0, threads=1),
    )
    one = study(tmp_path, ("energy-shaping", "energy-shaping-tuned"))
    found = load_tree("legv2") | {"name": "found"}
    for tuning in one.tunings():
        file = Path(tuning.source)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(robot_text(found))
        tuning.run(quiet=True)
        assert tuning.done
    trials = {job.method: job for job in one.hops() if job.twin.name == "twin-1"}
    tuned = trials["energy-shaping-tuned"].controller
    assert tuned.gains != trials["energy-shaping"].controller.gains
    assert tuned.robot.name == "found"


def test_of_several_trainings_the_better_one_is_chosen_in_its_own_simulation_alone(tmp_path):
    one = study(tmp_path, seeds=(0, 1), commands=(0.25, 0.35))
    good, bad = (0.01, 0.01), (0.1, 0.1)
    rows = []
    for method in one.methods:
        for number, twin in enumerate(one.twins):
            best = number if (method.fit or method.truth) else 1
            for seed in one.seeds:
                folder = one.training(twin, method, seed).folder
                folder.mkdir(parents=True, exist_ok=True)
                selected = {"selected": {"score_m": 0.002 if seed == best else 0.3}}
                (folder / "result.json").write_text(json.dumps(selected))
                errors = {method.name: {twin.name: bad if seed == best else good}}
                rows += [{**row, "seed": seed} for row in trials(errors)]
    (found,) = best_in_own_simulation(one, rows).values()
    assert [row["policies"] for row in found["methods"]] == [2, 2]
    assert [row["worst_abs_error_m"] for row in found["methods"]] == [0.1, 0.1]
    assert found["comparison"][0]["ratio"] == pytest.approx(1.0)
    assert best_in_own_simulation(study(tmp_path), rows) == {}


def test_twins_are_drawn_or_brought(tmp_path):
    one, again = (find_twins(["2"], tmp_path) for _ in range(2))
    assert one == again
    assert one[0].robot.digest != one[1].robot.digest
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nextends = "legv2-paper"\n')
    assert [twin.name for twin in find_twins([str(file), "twin"], tmp_path)] == ["mine", "twin"]
    for words, error in (
        (["0"], "too few"),
        (["legv2"], "extends no robot"),
        ([str(file), str(file)], "Two twins are called 'mine'"),
        (["legv9"], "There is no robot"),
    ):
        with pytest.raises((UsageError, RobotError), match=error):
            find_twins(words, tmp_path)


def test_trainings_that_do_not_depend_on_the_twin_are_shared(tmp_path):
    one = study(tmp_path, ("identified", "cad", "randomised"))
    folders = [training.folder.name for training in one.trainings()]
    assert sorted(folders) == [
        "legv2-seed0", "legv2-twins-seed0", "twin-0-identified-seed0", "twin-1-identified-seed0",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"seconds": 5.0}, "too short"),
        ({"steps": 0}, "at least 1"),
        ({"seeds": ()}, "each given once"),
        ({"seeds": (1, 1)}, "each given once"),
        ({"seeds": (-1,)}, "each given once"),
    ],
)
def test_options_without_meaning_are_refused(tmp_path, options, says):
    with pytest.raises(UsageError, match=says):
        study(tmp_path, **options)


def test_methods_are_checked():
    with pytest.raises(UsageError, match="Did you mean 'identified'"):
        choose_methods(["identifed"])
    with pytest.raises(UsageError, match="named twice"):
        choose_methods(["cad", "cad"])
    with pytest.raises(UsageError, match="No method"):
        choose_methods([])
