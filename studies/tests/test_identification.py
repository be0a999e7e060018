import json

import numpy as np
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import cut
from hopping_leg.robot import COARSE_TIMESTEP, load_robot
from studies.identification import friction, mujoco_sysid
from studies.identification.bars import bars
from studies.identification.fits import compare, summary
from studies.identification.real import real
from studies.identification.run import Identify, bench_identify
from studies.identification.study import FitCache, Study
from studies.identification.synthetic import FIXED, identify_twin
from studies.identification.throughput import PlainLoop
from studies.identification.twin import AIR, GROUND, record, twin
from studies.shared import main


def test_twins_are_recorded_with_a_finer_step_than_fits_take():
    recording = record(AIR, "swings", 16.0)
    plan = make_plan([recording], load_robot("legv2"))
    assert recording.trace.header["timestep_s"] < plan.timestep == COARSE_TIMESTEP


@pytest.mark.parametrize(("motion", "error"), [("swings", 3e-4), ("hops", 3e-3)])
def test_plain_loop_and_replay_simulate_the_same(motion, error):
    recordings = [record(GROUND, motion, 16.0)]
    windows = cut(recordings, 0.25)[4::24]
    candidate = LegHypothesis(load_robot("legv2"))
    plain = np.stack(PlainLoop(recordings, windows, COARSE_TIMESTEP / 16).run(candidate))
    replay = WindowSimulator(recordings, windows, timestep=COARSE_TIMESTEP, threads=1)
    replayed = replay.run([candidate]).position[0]
    np.testing.assert_allclose(plain, replayed, atol=error)
    start = np.array([recordings[0].array("position")[w.start] for w in windows])
    np.testing.assert_allclose(plain[:, 0], start, atol=1e-9)
    assert np.ptp(plain, axis=1).max() > 0.2


def test_a_law_of_friction_helps_where_it_is_the_truths_and_noise_helps_nothing():
    rng = np.random.default_rng(0)
    every = []
    for _ in range(4):
        plain, right, wrong = (rng.normal(size=(800, k)) for k in (3, 4, 64))
        right[:400, 2:] = right[400:, :2] = 0.0
        target = plain @ (1.0, 2.0, 3.0) + right @ np.ones(4) + 0.3 * rng.normal(size=800)
        columns = dict.fromkeys(friction.LAWS, wrong) | {"Stribeck": right}
        every.append(friction.Equations(plain, columns, target))
    rows = {row["law"]: row for row in friction.judge(every)["rows"]}
    assert rows["Stribeck"]["share"] < 0.3
    assert rows["network"]["share"] == pytest.approx(1.0, abs=0.02)
    result = {"friction": {"rows": [{"states": "smoothed", **row} for row in rows.values()]}}
    (bar,) = bars(result)
    assert bar["reached"]
    assert bar["measured"] == rows["Stribeck"]["share"]


def test_work_is_done_once(tmp_path):
    begun = []
    cache = FitCache(tmp_path, begun.append)
    for asked, number in (({"size": 1}, 7), ({"size": 1}, 8), ({"size": 2}, 9)):
        result = cache.load_or_run("part", "words", asked, lambda n=number: {"number": n})
        assert result == {"number": 7 if asked["size"] == 1 else 9}
    assert len(begun) == 2


def test_errors_are_relative_to_the_truth_and_claims_are_counted():
    rows = compare({"hip.friction": 0.111, "drive.delay": 1e-4}, {"hip.friction": 0.11}, ["x"])
    assert rows[0]["error_percent"] == pytest.approx(100 / 110)
    assert rows[1]["error_percent"] is None
    assert summary(rows)["identifiable"] == 0
    told = summary(compare({"hip.friction": 0.111}, {"hip.friction": 0.11}, ["hip.friction"]))
    assert told["worst_identifiable_error_percent"] == pytest.approx(100 / 110)
    assert summary(compare({"hip.friction": 0.1}, AIR, None))["identifiable"] is None


def test_bars_know_which_side_is_better():
    speed = {
        "fixed_base_candidate_s": 0.05,
        "paper_size_share": 0.25,
        "replay_one_thread_over_loop": 50.0,
        "replay_two_threads_over_one": 1.9,
    }
    rows = [
        {
            "rig": "double pendulum",
            "predicted_0_2_s_rms_rad": [0.010, 0.030],
            "predicted_0_5_s_rms_rad": [0.020, None],
        },
        {
            "rig": "double pendulum",
            "predicted_0_2_s_rms_rad": [0.011, 0.020],
            "predicted_0_5_s_rms_rad": [0.034, None],
        },
    ]
    found = bars({"throughput": speed, "recordings": {"rows": rows}})
    assert [row["reached"] for row in found] == [False, True, True, True, False, False]
    assert found[3]["measured"] == pytest.approx(11.0)


def test_bad_input_is_one_sentence(tmp_path):
    with pytest.raises(UsageError, match=r"'physics'.*synthetic"):
        bench_identify(Study(), FitCache(tmp_path), parts=["physics"])
    with pytest.raises(UsageError, match="legv2_fixed_base"):
        real(Study(), FitCache(tmp_path), tmp_path)
    assert main("identification", Identify, ["--population", "1"]) == 2
    assert main("identification", Identify, ["--seconds", "8"]) == 2


def test_a_missing_extra_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(mujoco_sysid, "available", lambda: False)
    result = mujoco_sysid.mujoco_sysid(Study(), FitCache(tmp_path), [])
    assert "hopping-leg[bench]" in result["missing"]
    assert result["rows"] == []


@pytest.mark.skipif(not mujoco_sysid.available(), reason="mujoco.sysid is not installed")
@pytest.mark.parametrize(("way", "error"), [("windows", 5e-4), ("whole", 1.5e-3)])
def test_the_truth_explains_the_data_to_mujoco_sysid(way, error):
    from mujoco import sysid

    from studies.identification.sequences import sequences

    names, values = tuple(AIR), tuple(AIR.values())
    cut_up = sequences(record(AIR, "swings", 16.0), way)
    parameters = sysid.ParameterDict()
    for name, value in AIR.items():
        parameters.add(sysid.Parameter(name, value, 0, 1))

    def largest(scale):
        vector = scale * np.array(values)
        parts = [
            sysid.model_residual(
                vector, parameters, lambda p: cut_up.build(names, tuple(p.as_vector())), t
            )[0]
            for t in cut_up.trajectories[:4]
        ]
        return np.abs(np.concatenate(parts)).max()

    assert largest(1.0) < error
    assert largest(2.0) > 3 * error


@pytest.mark.slow
def test_the_command_measures_keeps_and_goes_on(tmp_path):
    file = tmp_path / "identify.json"
    words = ["--parts", "throughput", "--population", "4", "--repeats", "1"]
    sizes = ["--throughput-seconds", "12", "--out", str(tmp_path / "kept"), "--json", str(file)]
    assert main("identification", Identify, [*words, *sizes]) == 0
    first = json.loads(file.read_text())
    speed = first["throughput"]
    assert all(row["s_per_candidate"] > 0 for row in speed["rows"])
    assert [row["bar"] for row in first["bars"]] == [0.15, 25.0, 1.8]
    assert "--throughput-seconds 12" in first["command"]
    assert "--out" not in first["command"]
    assert main("identification", Identify, [*words, *sizes]) == 0
    assert json.loads(file.read_text())["throughput"] == speed


@pytest.mark.slow
def test_a_known_twin_is_found():
    row = identify_twin(Study(threads=1), lambda *_: None, FIXED, "least-squares")
    assert row["worst_identifiable_error_percent"] < 0.5
    assert row["identifiable"] == 8
    assert row["other_swings_rms_rad"] < 1e-3
    assert twin(AIR) != load_robot("legv2")


@pytest.mark.slow
def test_intervals_hold_the_truth_of_independent_arms(tmp_path):
    result = bench_identify(Study(arms=12, seed=500), FitCache(tmp_path), parts=["coverage"])
    assert result["coverage"]["share_inside"] > 0.9
