"""What is met depends on the seed alone, grows with the level and is nothing at the neutral one."""

import dataclasses
import json

import numpy as np
import polars as pl
import pytest

from hopping_leg.controllers import rollout
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import Entry, robustness
from hopping_leg.evaluate.figures import draw_robustness
from hopping_leg.evaluate.robustness import Suite, make_trials, outcome, run_suite
from hopping_leg.evaluate.robustness_axes import AXES, JOINT, Case, axes_named
from hopping_leg.figures import encode
from hopping_leg.sim import LegSimulator
from tests.evaluate.test_metrics import sine_trace, window_of

COMMANDS = (0.25, 0.35)


@pytest.fixture
def plan(setup):
    def make(name, levels=None, commands=COMMANDS, repeats=2, **options):
        (axis,) = axes_named([name])
        suite = Suite(setup, commands, (axis,), repeats=repeats, **options)
        return make_trials(dataclasses.replace(axis, levels=levels or axis.levels), suite)

    return make


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_a_neutral_level_is_the_plain_rollout_bit_for_bit(setup, plan, spring, axis):
    made = plan(axis.name, [axis.neutral], seconds=2.6)
    found = rollout(spring, setup, made.commands, made.seed, perturbation=made.perturbation)
    asked = np.tile(np.repeat(COMMANDS, 2), (len(found.time), 1))
    plain = rollout(spring, setup, asked, made.seed)
    for name, values in plain.data.items():
        np.testing.assert_array_equal(found.data[name], values)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_levels_and_moderate_ranges_lie_around_the_neutral_level(robot, axis):
    low, high = axis.moderate
    assert low <= axis.neutral <= high
    assert axis.neutral not in axis.levels
    assert min(axis.levels) <= low or low == axis.neutral
    assert max(axis.levels) >= high or high == axis.neutral
    altered = [axis.alter(Case(robot), level) for level in axis.levels]
    assert len(set(map(repr, altered))) == len(axis.levels)
    for case in altered:
        assert case.robot.thigh.length == robot.thigh.length
    assert LegSimulator(robot, len(altered), robots=[case.robot for case in altered]).count


def test_levels_differ_in_size_only(plan):
    force = plan("pushes", [0.1, 0.3]).perturbation.force
    small, large = force[:, :4], force[:, 4:]
    np.testing.assert_allclose(large, 3 * small)
    assert (np.count_nonzero(small, axis=0) == 9 * round(robustness.PUSH_SECONDS * 200)).all()
    assert np.abs(small).sum(axis=0) / 200 == pytest.approx(np.full(4, 0.9))


def test_commands_step_away_and_back_within_the_suites_heights(plan):
    made = plan("command-steps", [0.04], (0.25, 0.3, 0.35), 1)
    pairs = [sorted(set(made.commands[:, leg].round(6))) for leg in range(3)]
    assert pairs == [[0.25, 0.29], [0.28, 0.32], [0.31, 0.35]]
    assert (np.abs(np.diff(made.commands, axis=0)) > 0).sum() == 3 * 3


def test_the_hypercube_stays_within_its_share_of_the_moderate_ranges(plan, robot):
    made = plan(JOINT.name)
    for trial in made.cases:
        share = trial.level
        added = (trial.robot.base.mass - robot.base.mass) / robot.mass
        assert -0.15 * share <= added <= 0.2 * share
        assert 0 < trial.robot.reality.latency.command <= 0.005 * share
    points = {t.push / t.level for t in made.cases}
    assert len({round(p, 9) for p in points}) == len(made.cases) / 4


def test_a_suite_repeats_and_names_its_rows(setup, spring):
    names, progress = ("links", "pushes"), []
    tiny = Suite(setup, (0.28, 0.32), axes_named(names), repeats=1, seconds=2.5)
    judged = [Entry("my spring", spring)]
    first = run_suite(judged, tiny, lambda _, share: progress.append(share))
    assert progress == sorted(progress)
    assert progress[-1] == 1
    assert json.dumps(first, allow_nan=False) == json.dumps(run_suite(judged, tiny))
    assert run_suite(judged, dataclasses.replace(tiny, seed=1))["levels"] != first["levels"]
    assert len({encode(draw_robustness(first), "svg") for _ in range(2)}) == 1
    assert [row["axis"] for row in first["scores"]] == [*names, "overall"]
    assert [axis["name"] for axis in first["axes"]] == [*names]
    assert {row["axis"] for row in first["levels"]} == {"nominal", *names}
    with pytest.raises(UsageError, match=r"no axis 'wind'.*pushes"):
        axes_named(["wind"])


def test_success_needs_every_hop_and_the_right_height(plan):
    trial = plan("delay").cases[0]

    def of(**changes):
        return outcome(trial, [dataclasses.replace(window_of(sine_trace(apex=0.319)), **changes)])

    assert of()["success"]
    assert not of(command=0.298)["success"]
    assert not of(skipped=1)["success"]
    still = of(apex=np.empty(0), command=0.22)
    assert still["error_m"] == pytest.approx(0.219 - 0.22)
    assert still["missed"]
    assert not still["success"], "standing at the right height is no hop"


def rows(level, *successes, repeats=None, **more):
    """Trials of a level, a realisation each unless ``repeats`` says which."""
    repeats = repeats or range(len(successes))
    default = {"error_m": 0.0, "missed": False, "skipped": 0, "contacts": 0}
    return pl.DataFrame(
        [
            {"level": level, "repeat": repeat, "success": success, **default, **more}
            for repeat, success in zip(repeats, successes, strict=True)
        ]
    )


def score(outcomes, seed=0):
    *own, found = robustness.score_rows("mine", outcomes, seed)
    assert [row["axis"] for row in own] == list(outcomes)
    assert found["trials"] == sum(row["trials"] for row in own)
    return found["score"], found["low"], found["high"]


def test_the_score_counts_every_axis_and_level_alike():
    many = rows(0.1, *[True] * 30, repeats=[0] * 30)
    few = pl.concat([many, rows(0.2, False, False, repeats=[0, 0])])
    assert score({"delay": few})[0] == pytest.approx(0.5)
    more = pl.concat([few, rows(0.3, False)])
    assert score({"delay": more, "links": many})[0] == pytest.approx((1 / 3 + 1) / 2)


def test_the_interval_is_over_realisations_not_over_trials():
    wins = (True, False, True)
    few = score({"delay": rows(0.1, *wins)}, 1)
    assert few[0] == pytest.approx(2 / 3)
    more = score({"delay": pl.concat([rows(0.1, *wins)] * 10)}, 1)
    assert more == few, "more trials of a realisation tell no more"
    assert few[2] - few[1] > 0.5
    steady = pl.concat([rows(0.1, *[True] * 20), rows(0.2, *[False] * 20)])
    middle, low, high = score({"delay": steady})
    assert middle == 0.5, "levels are chosen, not drawn: their difference is no scatter"
    assert high - low < 0.2


def test_rows_tell_levels():
    good = pl.concat([rows(0.1, True), rows(0.1, True, error_m=0.01)])
    bad = [rows(0.2, False, error_m=-0.05, contacts=3), rows(0.2, False, error_m=-0.09, skipped=4)]
    levels = robustness.level_rows("mine", "delay", pl.concat([*bad, good]))
    assert [(row["level"], row["success"]) for row in levels] == [(0.1, 1.0), (0.2, 0.0)]
    assert levels[1]["median_abs_error_m"] == pytest.approx(0.07)
    assert (levels[1]["skipped_hops"], levels[1]["body_contacts"]) == (4, 3)
