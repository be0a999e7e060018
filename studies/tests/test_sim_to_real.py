"""The sim-to-real study: the whole chain from the command line, and what it refuses."""

import json

import pytest

from studies import shared
from studies.sim_to_real.run import Experiment

pytest.importorskip("torch")


def main(words):
    return shared.main("sim_to_real", Experiment, words, ("threads",))


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
        "python -m studies.sim_to_real --twins 1 --methods truth --steps 1"
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
    words = ["prediction", "--folder", str(folder), "--json", str(file)]
    words += ["--twins", "2", "--repeats", "1", "--commands", "0.25,0.35"]
    assert main([*words, "--methods", "truth", "cad"]) == 0
    found = json.loads(file.read_text())
    assert found["command"].startswith("python -m studies.sim_to_real prediction --twins 2")
    told = {row["method"]: row for row in found["methods"] if row["controller"] == "fast"}
    assert told["truth"]["median_abs_error_m"] < told["cad"]["median_abs_error_m"]
    assert set(told["truth"]["errors_m"]) == {"twin-0", "twin-1"}
    assert not (folder / "training").exists()
    assert "foretells" in capsys.readouterr().out
    assert main([*words, "--methods", "randomised"]) == 2
    assert "none foretells" in capsys.readouterr().err
