import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Entry, evaluate, runner
from hopping_leg.evaluate.robustness import Suite, run_suite
from hopping_leg.evaluate.robustness_axes import axes_named
from hopping_leg.evaluate.runner import load_entries
from hopping_leg.evaluate.trials import COMMANDS, choose_commands, floor_robot, paper_trials
from hopping_leg.robot import GRAVITY, load_robot
from hopping_leg.sim import NO_NOISE, NoiseAndDelay
from tests.evaluate.conftest import Spring


def test_summary_rows_pool_fixed_trials_and_the_sequence(judged, robot):
    rows = judged.evaluation.summary
    assert [(r.controller, r.robot, r.command_m) for r in rows] == [
        ("spring", "legv2-paper", 0.25),
        ("spring", "legv2-paper", 0.35),
    ]
    assert all(row.runs == 4 for row in rows)
    assert [r.hops / r.hop_rate_hz for r in rows] == pytest.approx([2 * (13 + 3), 2 * (13 + 4)])
    apexes = judged.evaluation.distributions[1]["apexes_m"]
    assert rows[1].hops == len(apexes) > 20
    assert rows[1].median_error_m == pytest.approx(np.median(apexes) - 0.35, abs=1e-5)
    assert rows[1].std_m == pytest.approx(np.std(apexes), abs=1e-5)
    least = robot.mass * GRAVITY * (np.mean(apexes) - judged.runs[0].trace.column("height_m")[0])
    assert rows[1].ballistic_energy_j == pytest.approx(least, abs=1e-3)
    used = rows[1].energy_over_ballistic * least * rows[1].hop_rate_hz
    assert used == pytest.approx(rows[1].mean_electrical_power_w, rel=1e-3)
    assert rows[1].median_error_low_m <= rows[1].median_error_m <= rows[1].median_error_high_m


def test_the_json_has_the_promised_names_and_no_nan(judged):
    data = json.loads(json.dumps(judged.evaluation.to_json(), allow_nan=False))
    promised = {
        "controller", "robot", "command_m", "median_error_m", "std_m", "hops", "skipped_hops",
        "flight_fraction", "hop_rate_hz", "min_base_height_m", "body_contacts", "max_sink_m",
    }  # fmt: skip
    assert promised <= data["summary"][0].keys()
    assert data["conditions"]["robot_digest"]
    assert data["conditions"]["seeds"] == 2
    row = dataclasses.replace(judged.evaluation.summary[0], median_error_m=float("nan"))
    empty = dataclasses.replace(judged.evaluation, summary=[row])
    assert empty.to_json()["summary"][0]["median_error_m"] is None


def test_the_stiff_floor_changes_the_contact_only(robot):
    stiff = floor_robot(robot, "stiff")
    assert (stiff.contact.time_constant, stiff.contact.damping_ratio) == (0.02, 1.0)
    assert dataclasses.replace(stiff, contact=robot.contact) == robot
    with pytest.raises(UsageError, match=r"no floor 'lava'.*soft, stiff"):
        floor_robot(robot, "lava")


def test_what_is_left_out_or_coarse_is_noted(setup, robot):
    result = evaluate(
        [Entry("spring", Spring(robot, (0.29, 0.33)))],
        dataclasses.replace(setup, timestep=1e-3),
        commands=[0.30],
        repeats=1,
        kinds=("ladder", "staircase"),
    ).evaluation
    assert "coarser" in result.notes.pop(0)
    assert [row.command_m for row in result.ladder] == [0.30, 0.32]
    assert "left out: staircase, ladder 0.22 m" in result.notes[0]


def robustness(entries, setup, commands, repeats=1):
    heights = choose_commands(setup.robot, commands, repeats)
    run_suite(entries, Suite(setup, heights, axes_named(["links"]), repeats))


@pytest.mark.parametrize("suite", [evaluate, robustness])
@pytest.mark.parametrize(
    ("names", "options", "sentence"),
    [
        ("", {}, "No controller"),
        ("aa", {}, "named twice"),
        ("a", {"repeats": 0}, "0 seeds are too few"),
        ("a", {"commands": [0.3, float("nan")]}, "cannot be asked for nan m"),
        ("a", {"commands": [0.25, 0.35]}, r"'a' cannot be asked for 0\.35 m.*0\.2 to 0\.3 m"),
    ],
)
def test_every_suite_refuses_bad_input_in_a_sentence(setup, suite, names, options, sentence):
    entries = [Entry(name, Spring(setup.robot, (0.2, 0.3))) for name in names]
    with pytest.raises(UsageError, match=sentence):
        suite(entries, setup, **{"commands": [0.25], **options})


@pytest.mark.parametrize(
    ("robot", "disturbance", "noted"),
    [("twin", NoiseAndDelay(), 1), ("twin", NO_NOISE, 0), ("legv2-paper", NoiseAndDelay(), 0)],
)
def test_a_twin_under_the_papers_disturbance_is_noted(robot, disturbance, noted):
    notes = runner._note_setup(RolloutConfig(load_robot(robot), disturbance))
    assert [note for note in notes if "came on top" in note] == notes
    assert len(notes) == noted


@pytest.mark.parametrize(
    ("knee", "speed", "stopped"),
    [(-1.0, -20.0, 0), (-2.69, 0.0, 0), (-2.71, 0.0, 2), (-2.65, -20.0, 2), (-2.65, 20.0, 0)],
)
def test_who_would_be_stopped_on_the_real_leg_is_noted(setup, knee, speed, stopped):
    columns = {
        "hip_position_rad": np.array([0.5, 0.6]),
        "hip_velocity_rad_s": np.zeros(2),
        "knee_position_rad": np.array([-1.0, knee]),
        "knee_velocity_rad_s": np.array([0.0, speed]),
    }
    runs = [SimpleNamespace(trace=SimpleNamespace(column=columns.get))] * 2
    notes = runner._note_stopped("mine", runs, setup)
    assert len(notes) == (stopped > 0)
    assert all(f"in {stopped} of 2 runs" in note for note in notes)


def test_the_papers_trials(robot):
    trials = paper_trials(robot)
    assert len({t.name for t in trials}) == len(trials)
    assert [t.steps for t in trials if t.kind == "fixed"] == [((c, 15.0),) for c in COMMANDS]
    (stairs,) = (t.commands(200.0) for t in trials if t.kind == "staircase")
    assert len(stairs) == 6000
    assert np.allclose(np.unique(stairs), [0.25, 0.27, 0.29, 0.31, 0.33, 0.35])
    (sequence,) = (t.commands(200.0) for t in trials if t.kind == "sequence")
    assert np.allclose(sequence[[0, 999, 1000, 2999]], [0.25, 0.25, 0.30, 0.35])


class FakePolicy:
    for_any_leg = False
    command_range = (0.2, 0.4)
    card = SimpleNamespace(recipe="fast", robot="other", robot_digest="0" * 16)
    stranger = Policy.stranger


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["1.onnx", "2.onnx", "1.onnx"], ["1.onnx", "2.onnx"]),
        (["mine=1.onnx"], ["mine"]),
        (["seed=1/1.onnx"], ["seed=1/1.onnx"]),
    ],
)
def test_files_and_labels_become_entries_with_ranges_and_warnings(
    robot, tmp_path, monkeypatch, names, labels
):
    for path in ("1.onnx", "2.onnx", "seed=1/1.onnx", "seed=2/1.onnx"):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runner, "Policy", FakePolicy)
    monkeypatch.setattr(runner, "load_controller", lambda *_, **__: FakePolicy())
    found = load_entries(names, robot, 200.0)
    assert [c.label for c in found] == labels
    assert found[0].command_range == (0.2, 0.4)
    assert found[0].notes[0].startswith(f"{labels[0]} was trained on robot 'other'")
