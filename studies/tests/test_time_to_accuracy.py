"""Accuracy over time: what counts, what is kept, and that a snapshot is the policy as it stood."""

import itertools
import math
from types import SimpleNamespace

import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")

import torch
from tests.rl.learners import ROBOT, TINY, TINY_FAST, try_briefly
from torch import nn

from hopping_leg.controllers.policy import Policy
from hopping_leg.rl.policy_evaluation import CommandResult
from studies.time_to_accuracy import libraries
from studies.time_to_accuracy import run as module
from studies.time_to_accuracy.run import TimeToAccuracy, over_commands, summarise

SHORT = TINY_FAST.replace(steps=256)


def hops(command, error, std=0.002, count=9, skipped=0):
    return CommandResult(command, error, std, count, 2.0, 0.5, skipped, 1, 0.15)


def row(recipe, seed, seconds, error, skipped=0):
    numbers = {"mean_abs_median_error_m": error, "mean_offset_m": -error, "mean_std_m": error / 2}
    numbers |= {"skipped_hops": skipped}
    return {"recipe": recipe, "seed": seed, "seconds": seconds, **numbers}


def test_errors_count_by_magnitude_and_a_height_without_hops_is_off_by_that_height():
    found = over_commands([hops(0.25, -0.004, skipped=2), hops(0.3, 0.002, std=0.006)])
    assert found["mean_abs_median_error_m"] == pytest.approx(0.003)
    assert found["worst_abs_median_error_m"] == pytest.approx(0.004)
    assert found["mean_offset_m"] == pytest.approx(-0.001)
    assert found["mean_std_m"] == pytest.approx(0.004)
    assert (found["skipped_hops"], found["body_contact_ticks"]) == (2, 2)
    found = over_commands([hops(0.25, 0.001), hops(0.35, math.nan, math.nan, 0)])
    assert found["worst_abs_median_error_m"] == pytest.approx(0.35)
    assert found["mean_std_m"] == pytest.approx(0.002)


def test_points_in_time_are_averaged_over_seeds_in_their_order():
    rows = [("b", 0, 10, 0.2), ("b", 0, 20, 0.1, 3), ("b", 1, 12, 0.4), ("b", 1, 24, 0.3, 4)]
    found = summarise([row(*numbers) for numbers in (*rows, ("a", 0, 5, 0.5))])
    assert [(r["recipe"], r["runs"]) for r in found] == [("b", 2), ("b", 2), ("a", 1)]
    first, second, other = found
    assert (first["seconds"], second["seconds"], other["seconds"]) == (11, 22, 5)
    assert first["mean_error_m"] == pytest.approx(0.3)
    assert second["worst_seed_mean_error_m"] == pytest.approx(0.3)
    assert second["mean_std_m"] == pytest.approx(0.1)
    assert second["skipped_hops"] == 7


def test_snapshots_of_stable_baselines3_come_at_equal_times_until_the_minutes_are_over(monkeypatch):
    """On a clock of which every step of the environments takes a 64th of a second."""
    clock = itertools.count(5.0, 1 / 64)
    monkeypatch.setattr(libraries, "time", SimpleNamespace(process_time=lambda: next(clock)))
    found = libraries.learn("sb3-ppo", ROBOT, 0, minutes=0.75 / 60, snapshots=3)
    assert [seconds for seconds, _, _ in found] == [0.25, 0.5, 0.75]
    legs = libraries.ALGORITHMS["sb3-ppo"]
    assert [steps for _, steps, _ in found] == [16 * legs, 32 * legs, 48 * legs]
    for _, steps, content in found:
        assert Policy(content, "snapshot", "s").card.steps == steps


@pytest.mark.parametrize("squashed", [False, True])
def test_an_actor_of_sbx_is_taken_over_with_its_weights(squashed):
    ends = (nn.ReLU(), nn.Tanh()) if squashed else (nn.Tanh(), nn.Identity())
    expected = nn.Sequential(nn.Linear(15, 8), ends[0], nn.Linear(8, 2), ends[1])
    weights = {name: value.detach().numpy().T for name, value in expected.named_parameters()}
    dense = {
        n: {"kernel": weights[f"{2 * n}.weight"], "bias": weights[f"{2 * n}.bias"]} for n in (0, 1)
    }
    state = SimpleNamespace(params={"params": {f"Dense_{n}": dense[n] for n in dense}})
    actor = SimpleNamespace(net_arch=[8])
    policy = SimpleNamespace(actor_state=state, actor=actor, squash_output=squashed)
    found, seen = libraries.torch_actor(SimpleNamespace(policy=policy)), torch.rand(5, 15)
    torch.testing.assert_close(found(seen), expected(seen))


@pytest.fixture
def tiny(monkeypatch, tmp_path):
    """Return what makes a study of small recipes in a folder; ``trained`` are their trainings."""
    monkeypatch.setattr(module, "TRAINED", {"fast": SHORT, "paper": TINY.replace(eval_every=400)})
    monkeypatch.setattr(module, "SHARES", {"fast": (0.5, 1.0)})
    try_briefly(monkeypatch)
    train = module.train

    def counted(recipe, robot, seed, folder, **options):
        if len(make.trained) == make.killed_after:
            raise KeyboardInterrupt
        make.trained.append((recipe.name, seed, recipe.schedule.steps))
        return train(recipe, robot, seed, folder, quiet=True, **options)

    def make(recipe):
        figure = tmp_path / "curves.svg"
        study = TimeToAccuracy((recipe,), (0,), robot=ROBOT.name, out=tmp_path, figure=figure)
        return study.measure()

    make.trained, make.killed_after = [], None
    monkeypatch.setattr(module, "train", counted)
    return make


def test_a_distillation_is_trained_anew_for_every_share_once_and_goes_on_if_killed(tiny, tmp_path):
    steps = SHORT.schedule.steps
    tiny.killed_after = 1
    with pytest.raises(KeyboardInterrupt):
        tiny("fast")
    tiny.killed_after = None
    found = tiny("fast")
    assert tiny.trained == [("fast", 0, steps // 2), ("fast", 0, steps)]
    assert [row["steps"] for row in found["rows"]] == [steps // 2, steps]
    assert {row["part"] for row in found["spent"]} >= {"rollouts", "gradient steps"}
    assert found["robots"] == {"fast": ROBOT.name}
    assert (tmp_path / "curves.svg").stat().st_size > 1000
    assert tiny("fast") == found
    assert len(tiny.trained) == 2


def test_of_a_recipe_without_shares_every_snapshot_is_judged(tiny):
    rows = tiny("paper")["rows"]
    assert len(tiny.trained) == 1
    assert [row["steps"] for row in rows] == sorted({row["steps"] for row in rows})
    assert len(rows) >= 2
    times = [row["seconds"] for row in rows]
    assert 0 < times[0] < times[-1]
    assert times == sorted(times)
