"""Probes find what is there, find nothing where nothing is, and judge on other legs."""

import json

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.energy_shaping.phases import Phase
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.rl.onnx_export import expose_hidden
from studies.probing.exposed import Exposed, record
from studies.probing.fitting import interval, probe
from studies.probing.run import Probe, Study
from studies.probing.targets import TARGETS
from studies.shared import main

RNG = np.random.default_rng(3)
BY_NAME = {target.name: target for target in TARGETS}


def samples(legs=8, ticks=200, size=5):
    return RNG.normal(size=(ticks, legs, size))


def test_what_is_linear_is_found_and_what_is_not_there_is_not():
    train, test, weights = samples(), samples(), RNG.normal(size=5)
    wanted, truth = 3 + train @ weights, 3 + test @ weights
    found = probe(train, wanted, test, truth, 0)
    assert found.score() > 0.999
    assert found.rms() < 0.01
    noise = probe(train, RNG.normal(size=wanted.shape), test, RNG.normal(size=truth.shape), 0)
    assert abs(noise.score()) < 0.05
    low, high = interval(noise, 0)
    assert low <= noise.score() <= high
    gain = interval(found, 0, noise)
    assert 0.9 < gain[0] < gain[1] < 1.1


def test_classes_count_alike_however_rare():
    train, test = samples(), samples()
    rare = [x[..., 0] > 1.5 for x in (train, test)]
    found = probe(train, rare[0].astype(float), test, rare[1].astype(float), 2)
    assert found.score() > 0.85
    assert found.rms() is None
    blind = probe(train[..., 1:], rare[0].astype(float), test[..., 1:], rare[1].astype(float), 2)
    assert blind.score() == pytest.approx(0.5, abs=0.12)


def test_what_is_unknown_does_not_count():
    train, test = samples(), samples()
    wanted, truth = train[..., 0].copy(), test[..., 0].copy()
    wanted[::2], truth[::3] = np.nan, np.nan
    assert probe(train, wanted, test, truth, 0).score() > 0.999
    for classes in (0, 2):
        nothing = probe(train, np.full_like(wanted, np.nan), test, truth, classes)
        assert np.isnan(nothing.score())
        assert np.isnan(interval(nothing, 0)).all()


def test_targets_are_those_of_the_true_state():
    clear = np.array([0.0, 0.01, 0.02, 0.01, 0.0, 0.0, 0.01])[:, None]
    truth = {
        "foot_clearance_m": clear,
        "height_rate_m_s": np.array([1.0, 1, 0, -1, -1, 1, 1])[:, None],
        "height_m": np.arange(7.0)[:, None],
    }
    seen = {name: target.values(truth, 200.0)[:, 0] for name, target in BY_NAME.items()}
    assert seen["contact"].tolist() == [1, 0, 0, 0, 1, 1, 0]
    flight, push, brake = Phase.FLIGHT, Phase.LIFTOFF, Phase.TOUCHDOWN
    assert seen["phase"].tolist() == [push, flight, flight, flight, brake, push, flight]
    np.testing.assert_allclose(seen["time to touchdown"][1:4], [0.015, 0.01, 0.005])
    assert np.isnan(seen["time to touchdown"][[0, 4, 5, 6]]).all()
    np.testing.assert_array_equal(seen["height in flight"], [np.nan, 1, 2, 3, np.nan, np.nan, 6])


def test_an_exposed_policy_acts_as_ever(robot):
    policy = load_policy("fast")
    commands = np.full((100, 3), 0.3)
    setup = RolloutConfig(robot, threads=1)
    plain = rollout(policy, setup, commands, 1)
    exposed = rollout(Exposed(policy, expose_hidden(policy.content)), setup, commands, 1)
    for name, values in plain.data.items():
        np.testing.assert_array_equal(values, exposed.data[name])


def test_too_little_is_refused():
    with pytest.raises(UsageError, match="too few"):
        Study(legs=1)
    with pytest.raises(UsageError, match="too few"):
        Study(seconds=2.0)


@pytest.mark.slow
def test_command_line_probes_a_policy(tmp_path, capsys):
    file, figure = tmp_path / "probe.json", tmp_path / "probe.svg"
    words = ["fast", "--commands", "0.28", "0.32", "--legs", "3"]
    words += ["--seconds", "4", "--threads", "1", "--json", str(file), "--figure", str(figure)]
    assert main("probing", Probe, words) == 0
    rows = json.loads(file.read_text())["rows"]
    assert {row["target"] for row in rows} == set(BY_NAME)
    scores = {(row["target"], row["features"]): row["score"] for row in rows}
    assert scores["contact", "hidden_0"] > 0.75
    assert all(row["low"] <= row["high"] for row in rows)
    assert all(row["gain"] == 0 for row in rows if row["features"] == "observation")
    assert figure.read_bytes().startswith(b"<?xml")
    assert main("probing", Probe, ["fast", "--commands", "0.9"]) == 2
    assert "trained for" in capsys.readouterr().err


def test_what_a_policy_remembers_is_kept_and_shuffled_alike(robot):
    policy = load_policy("adaptive")
    graphs = {"": expose_hidden(policy.content), ", shuffled": expose_hidden(policy.content, 1)}
    commands = np.full((600, 2), 0.3)
    recording = record(policy, graphs, RolloutConfig(robot, threads=1), commands, 1)
    aims = recording.features["memory"]
    assert aims.shape == (200, 2, 3)
    assert np.abs(np.diff(aims[..., :2], axis=0)).max() > 0
    shown = {name: values.shape for name, values in recording.features.items()}
    assert {n: shown[f"{n}, shuffled"] for n in shown if f"{n}, shuffled" in shown} == {
        name: shape
        for name, shape in shown.items()
        if name != "observation" and not name.endswith("shuffled")
    }
