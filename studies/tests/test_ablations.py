"""All variants train as long, and one that does not hop says so."""

import pytest

from hopping_leg.rl.recipes import VARIANTS
from studies.ablations import run as bench


def row(command, error, skipped):
    hops = {"command_m": command, "median_error_m": error, "std_m": error and 0.004}
    return {**hops, "skipped_hops": skipped, "body_contacts": 1}


def trained_to(*rows, exams=()):
    """Return what a training comes to."""
    run = {"seed": 0, "minutes": 1.0, "teacher_scores_m": list(exams), "selected": list(rows)}
    return {"rows": list(rows), "runs": [run]}


def test_all_variants_train_as_long_and_are_summed_up(monkeypatch, tmp_path, robot):
    trained = []

    def train(recipe, _robot, out, **_options):
        trained.append((out.name, recipe.schedule.steps))
        hops = None if out.name == "no-event" else -0.003
        return trained_to(row(0.25, 0.001, 0), row(0.35, hops, 2), exams=[0.004])

    monkeypatch.setattr(bench, "bench_training", train)
    result = bench.bench_ablation("fast", robot, tmp_path, steps=1000)
    assert trained == [(name, 1000) for name in VARIANTS["fast"]]
    found = {variant["variant"]: variant for variant in result["variants"]}
    assert found["recipe"]["worst_abs_median_error_m"] == pytest.approx(0.003)
    assert found["recipe"]["mean_abs_median_error_m"] == pytest.approx(0.002)
    assert (found["recipe"]["skipped_hops"], found["recipe"]["body_contacts"]) == (2, 2)
    assert (found["recipe"]["seed"], found["recipe"]["teacher_scores_m"]) == (0, [0.004])
    assert found["no-event"]["mean_abs_median_error_m"] is None


def test_named_variants_alone_train_in_the_order_of_all(monkeypatch, tmp_path, robot):
    trained = []

    def train(_recipe, _robot, out, **_options):
        trained.append(out.name)
        return trained_to(row(0.25, 0.001, 0))

    monkeypatch.setattr(bench, "bench_training", train)
    bench.bench_ablation("fast", robot, tmp_path, steps=1000, variants=["no-event", "recipe"])
    assert trained == ["recipe", "no-event"]
    with pytest.raises(bench.UsageError, match=r"variant of fast 'no-events'.*'no-event'"):
        bench.bench_ablation("fast", robot, tmp_path, steps=1000, variants=["no-events"])


def test_a_recipe_without_ablations_is_refused(tmp_path, robot):
    with pytest.raises(bench.UsageError, match=r"'paper'.*fast"):
        bench.bench_ablation("paper", robot, tmp_path, steps=1000)
