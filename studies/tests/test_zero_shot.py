"""Controllers on legs that they have never met: what is counted, and what is told of a leg."""

import json

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.joint_pd import JointPD
from hopping_leg.controllers.registry import load_controller
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.sim.any_leg import draw_leg
from hopping_leg.sim.randomization import draw_twin

pytest.importorskip("moteus")
from studies import shared
from studies.sim_to_real import zero_shot
from studies.sim_to_real.run import Options
from studies.sim_to_real.twins import drawn_twin
from studies.sim_to_real.zero_shot import believed_of, pair, summarize

LEG = load_robot("legv2-identified")
ROW = {"body_contacts": 0, "stop_contacts": 0, "skipped_hops": 0, "std_m": 0.001,
       "would_be_stopped": False, "reached": True, "hops": 9, "hops_within_10mm": 8,
       "missed_hops": 1}  # fmt: skip


def row(controller, robot, command, error, noise="on", **more):
    errors = {"median_abs_error_m": error, "mean_abs_error_m": error}
    place = {"controller": controller, "robot": robot, "command_m": command, "disturbance": noise}
    return {**ROW, **place, **errors, **more}


def test_of_a_twin_what_it_extends_is_told_and_of_another_leg_all(tmp_path):
    draw_twin(3).save(tmp_path / "twin.toml")
    draw_leg(3).save(tmp_path / "leg.toml")
    assert believed_of(str(tmp_path / "twin.toml")) == load_robot("legv2")
    assert believed_of(str(tmp_path / "leg.toml")) == draw_leg(3).robot


def test_twins_may_rub_more_and_have_a_weak_hip(tmp_path):
    usual, hard = drawn_twin(3, tmp_path / "a").robot, drawn_twin(3, tmp_path / "b", 1.5, 0.5).robot
    assert usual == draw_twin(3).robot
    for joint in ("hip", "knee"):
        assert 1.5 < getattr(hard, joint).friction < 2.0
    gains = {leg.reality.hip.torque_gain for leg in (usual, hard)}
    assert min(gains) == pytest.approx(max(gains) / 2, rel=1e-5)


def test_a_leg_that_stands_misses_by_what_it_stands_too_low_and_one_that_hops_by_its_hops():
    config = RolloutConfig(LEG, NO_NOISE, threads=1)
    commands = np.full((1000, 1), 0.3)
    standing = rollout(JointPD(config.start_posture[None]), config, commands, 0)
    found = pair(standing, 0, 0.3, LEG)
    assert found["hops"] == 0
    assert found["median_abs_error_m"] == pytest.approx(0.3 - standing.data["height_m"][0, 0])
    assert found["std_m"] is None
    assert (found["hops_within_10mm"], found["missed_hops"]) == (0, max(found["skipped_hops"], 1))
    hopping = rollout(load_controller("energy-shaping", LEG), config, commands, 0)
    found = pair(hopping, 0, 0.3, LEG)
    assert 3 <= found["hops"] <= 10, "the first five do not count"
    assert found["median_abs_error_m"] < 0.01
    assert found["hops"] / 2 < found["hops_within_10mm"] <= found["hops"]
    assert not found["would_be_stopped"]
    hopping.data["knee_velocity_rad_s"][500] = 40.0
    assert pair(hopping, 0, 0.3, LEG)["would_be_stopped"]


def test_shares_are_of_all_pairs_and_hops_and_closeness_is_pair_by_pair():
    pairs = [
        row("one", "a", 0.3, 0.002),
        row("one", "a", 0.4, 0.004, hops=10, hops_within_10mm=5, missed_hops=0),
        row("one", "b", 0.3, 0.009, would_be_stopped=True),
        row("one", "b", 0.4, 0.5, reached=False),
        row("energy-shaping", "a", 0.3, 0.003),
        row("energy-shaping", "a", 0.4, 0.003),
        row("energy-shaping", "b", 0.3, 0.02),
        row("energy-shaping-tuned", "a", 0.3, 0.001),
        row("energy-shaping-tuned", "a", 0.4, 0.001, "off"),
        row("one", "a", 0.4, 0.1, "off"),
    ]
    one, shaped, *_, undisturbed = summarize(pairs)
    shares = {"within_5mm": 2 / 4, "within_10mm": 3 / 4, "would_be_stopped": 1 / 4}
    shares |= {"hops_within_10mm": 29 / 40, "reached_within_10mm": 1}
    closer = {"closer_than_energy_shaping": 2 / 3, "closer_than_tuned": 0}
    expected = {"pairs": 4, **shares, **closer}
    assert {name: one[name] for name in expected} == pytest.approx(expected)
    assert shaped["closer_than_energy_shaping"] is None
    assert (undisturbed["disturbance"], undisturbed["within_10mm"]) == ("off", 0)


def test_who_is_closer_is_as_the_pages_say():
    met, others, noisy = (
        json.loads((shared.ROOT / f"studies/sim_to_real/results/{name}.json").read_text())
        for name in ("zero_shot_twins", "zero_shot_seeds", "fast_noise_on")
    )
    on = {row["controller"]: row for row in met["summary"] if row["disturbance"] == "on"}
    _, *trainings, small, tuned = others["summary"]
    assert (len(trainings), small["controller"]) == (3, "runs/small/small.onnx")
    pairs = [(on["universal"], on["energy-shaping-tuned"]), *((t, tuned) for t in trainings)]
    assert small["hops_within_10mm"] > 0.9 * trainings[0]["hops_within_10mm"]
    for row, gains in pairs:
        assert 0.4 < row["closer_than_tuned"] < 0.6
        assert row["hops_within_10mm"] > gains["hops_within_10mm"]
        assert row["median_std_m"] > gains["median_std_m"]
    error = {row["method"]: row["median_abs_error_m"] for row in noisy["methods"]}
    assert sorted(error, key=error.get)[:2] == ["energy-shaping-identified", "energy-shaping-tuned"]
    assert error["identified-belt"] < error["energy-shaping"]
    assert 0.8 < error["identified"] / error["cad"] < 1.2 < error["two-pass"] / error["cad"]


def test_the_command_writes_pairs_and_summary_and_goes_on(tmp_path, capsys):
    robots = tmp_path / "robots"
    draw_twin(1).save(robots / "twin-1.toml")
    draw_leg(2).save(robots / "leg-2.toml")
    words = ["zero-shot", "--controllers", "energy-shaping", "--folder", str(robots)]
    words += ["--commands", "0.26", "0.32", "--seconds", "3", "--out", str(tmp_path / "out")]
    words += ["--disturbance", "on", "off", "--json", str(tmp_path / "zero.json")]
    assert shared.main("sim_to_real", Options, words) == 0
    found = json.loads((tmp_path / "zero.json").read_text())
    tried = {(r["controller"], r["disturbance"]) for r in found["pairs"]}
    assert tried == {("mpc-true-state", "off"), ("energy-shaping", "on"), ("energy-shaping", "off")}
    assert {r["robot"] for r in found["pairs"]} == {"twin-1", "leg-2"}
    larger = {r["command_m"] for r in found["pairs"] if r["robot"] == "leg-2"}
    assert larger == set(zero_shot.trials.scaled((0.26, 0.32), draw_leg(2).robot))
    noisy, quiet = found["summary"][1:]
    assert noisy["median_abs_error_m"] != quiet["median_abs_error_m"]
    trials = sorted((tmp_path / "out" / "trials").glob("*.json"))
    written = [file.stat().st_mtime_ns for file in trials]
    assert shared.main("sim_to_real", Options, words) == 0
    assert [file.stat().st_mtime_ns for file in trials] == written
    capsys.readouterr()
    assert shared.main("sim_to_real", Options, [*words[:4], str(tmp_path)]) == 2
    assert "hop robots draw twins" in capsys.readouterr().err
