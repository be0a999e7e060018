"""Cost, parameters and both searches on twins whose parameters are known."""

import dataclasses

import numpy as np
import pytest

from hopping_leg.errors import RecordingError, UsageError
from hopping_leg.identify.candidate import Candidate
from hopping_leg.identify.cma import CmaOptions, cma_es
from hopping_leg.identify.cost import Cost, Scoring
from hopping_leg.identify.identifiability import identifiability
from hopping_leg.identify.least_squares import (
    Found,
    LeastSquaresOptions,
    jacobian,
    least_squares,
    multi_start,
)
from hopping_leg.identify.objective import Objective
from hopping_leg.identify.parameters import choose
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.searching import Searcher, SearchOptions
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.two_pass import two_pass
from hopping_leg.identify.windows import cut
from tests.identify.twin import LEG, STEP, record, swing

CAD = Candidate(LEG)
TRUTH = {"hip.friction": 0.12, "hip.damping": 0.05, "knee.friction": 0.08, "knee.damping": 0.02}
RUN = record(CAD.replace(TRUTH).robot, swing(2.0))
SCORING = Scoring(position=0.001, torque=0.05)


def objective(parameters, scoring=SCORING, recordings=(RUN,)):
    return Objective(tuple(recordings), tuple(cut(recordings, 0.5)), parameters, scoring, STEP)


BOTTOM = np.array([1.0, -0.5])


def bowl(vectors):
    """Return residuals of a tilted bowl with its bottom at (1, -0.5)."""
    return vectors @ np.array([[2.0, 0.3], [0.1, 1.0]]) - np.array([1.95, -0.2])


TWO = choose(CAD, ["hip.friction", "knee.friction"])


def test_the_paper_cost_is_the_sum_of_squared_position_errors():
    simulator = WindowSimulator([RUN], cut([RUN], None), timestep=STEP)
    simulated = simulator.run([CAD]).position[0, 0, 1:]
    expected = np.sum((simulated - RUN.array("position")[1:]) ** 2)
    assert Cost(simulator).values([CAD])[0] == pytest.approx(expected, rel=1e-12)


def test_a_robust_cost_counts_small_errors_alike_and_large_ones_less():
    simulator = WindowSimulator([RUN], cut([RUN], None), timestep=STEP)
    plain = Cost(simulator, Scoring(position=0.01)).residuals([CAD])
    robust = Cost(simulator, Scoring(position=0.01, robust=0.5)).residuals([CAD])
    small, large = np.abs(plain) < 0.02, np.abs(plain) > 1.0
    np.testing.assert_allclose(robust[small], plain[small], rtol=1e-3, atol=1e-12)
    assert large.any()
    assert (np.abs(robust[large]) < np.abs(plain[large])).all()


def test_unmeasured_samples_do_not_count():
    table = RUN.trace.table.with_columns(hip_torque_nm=None)
    run = RUN.__class__(RUN.trace.__class__(table), RUN.setup, "partial")
    both, one = (
        Cost(WindowSimulator([r], cut([r], None), timestep=STEP), Scoring(None, None, 1.0)).size
        for r in (RUN, run)
    )
    assert one == both / 2
    gone = run.__class__(
        run.trace.__class__(table.with_columns(knee_torque_nm=None)), run.setup, "none"
    )
    simulator = WindowSimulator([gone], cut([gone], None), timestep=STEP)
    with pytest.raises(RecordingError, match="no measured sample"):
        Cost(simulator, Scoring(None, None, 1.0))


@pytest.mark.parametrize(
    ("names", "bounds", "sentence"),
    [
        (["hip.frction"], {}, "Did you mean 'hip.friction'"),
        (["hip.friction"], {"hip.friction": (0.5, 1.0)}, "exclude its start"),
        (["hip.friction", "hip.friction"], {}, "named twice"),
        (["drive.hip.stiffness"], {}, "no value to start from"),
        ([], {}, "nothing to fit"),
    ],
)
def test_parameters_that_make_no_sense_get_a_sentence(names, bounds, sentence):
    with pytest.raises(UsageError, match=sentence):
        choose(CAD, names, bounds=bounds)


def test_vectors_and_values_are_inverse():
    values = np.array([0.3, 0.2])
    np.testing.assert_allclose(TWO.values(TWO.vector(values)), values)
    (candidate,) = TWO.candidates(TWO.vector(values)[None])
    assert candidate.get("hip.friction") == pytest.approx(0.3)


def test_least_squares_finds_the_twin():
    parameters = choose(CAD, list(TRUTH))
    found = least_squares(objective(parameters).residuals, parameters)
    values = parameters.values(found.vector)
    np.testing.assert_allclose(values, list(TRUTH.values()), rtol=2e-3)


def test_cma_es_finds_the_bottom_of_a_bowl():
    found = cma_es(lambda v: np.square(bowl(v)).sum(1), TWO, CmaOptions(60), seed=3)
    np.testing.assert_allclose(found.vector, [1.0, -0.5], atol=1e-4)
    assert found.history == sorted(found.history, reverse=True)


SHIFTS = 0.3 * np.random.default_rng(0).normal(size=(5, 2))
SHIFTS -= SHIFTS.mean(axis=0)
SHARES = [
    lambda vectors, shift=shift: np.square(bowl(vectors - shift)).sum(1) / len(SHIFTS)
    for shift in SHIFTS
]
"""Bowls with different bottoms, that of their sum at (1, -0.5)."""


def sum_of_shares(vectors):
    return sum(share(vectors) for share in SHARES)


def test_shares_in_turn_find_the_bottom_of_their_sum():
    found = cma_es(sum_of_shares, TWO, CmaOptions(80), seed=3, shares=SHARES)
    assert found.cost == sum_of_shares(found.vector[None])[0] == found.history[-1]
    own = sum_of_shares(SHIFTS + BOTTOM)
    (least,) = sum_of_shares(BOTTOM[None])
    assert found.cost - least < 0.05 * (own.mean() - least)


def test_a_share_judges_a_generation_and_the_whole_only_the_last_ones():
    counted = {"share": 0, "whole": 0}

    def count(name, function):
        def run(vectors):
            counted[name] += len(vectors)
            return function(vectors)

        return run

    shares = [count("share", share) for share in SHARES]
    cma_es(count("whole", sum_of_shares), TWO, CmaOptions(20), seed=0, shares=shares)
    assert counted["share"] == 20 * 16
    assert 0 < counted["whole"] < 16


def test_a_search_by_shares_ends_where_they_agree():
    share = [lambda vectors: np.square(bowl(vectors)).sum(1) / 2] * 2
    found = cma_es(lambda v: np.square(bowl(v)).sum(1), TWO, CmaOptions(500), seed=3, shares=share)
    assert len(found.history) < 100
    np.testing.assert_allclose(found.vector, [1.0, -0.5], atol=3e-3)


def noisy(run):
    """Return the run as seen by poor sensors, so that windows disagree."""
    rng = np.random.default_rng(0)
    table = run.trace.table.with_columns(
        run.trace.table[f"{joint}_position_rad"] + rng.normal(scale=1e-3, size=len(run))
        for joint in ("hip", "knee")
    )
    return make_recording(table, run.setup, "noisy")


def test_shares_of_the_windows_find_more_in_the_same_time():
    parameters = choose(CAD, list(TRUTH))
    run = noisy(RUN)
    goal = Objective((run,), tuple(cut([run], 0.1)), parameters, Scoring(), STEP)
    plan = make_plan([run], LEG, parameters=tuple(TRUTH), search="cma")
    ends = []
    for generations, seconds in ((5, np.inf), (20, 0.5)):
        options = SearchOptions(cma=CmaOptions(generations, 10, seconds=seconds))
        searcher = Searcher(plan, goal, options, 0, None, lambda *told: None, None, {})
        ends.append(searcher.run(["fixed-base"])[0].found)
    whole, shared = ends
    assert shared.cost == goal(shared.vector[None])[0]
    assert shared.cost < 0.5 * whole.cost


def killed(function, after):
    """Return the function, which breaks at one of its calls as a kill would."""
    calls = iter(range(after))

    def run(vectors):
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return function(vectors)

    return run


def test_a_killed_cma_es_resumes_exactly(tmp_path):
    def values(vectors):
        return np.square(bowl(vectors)).sum(1)

    options = CmaOptions(20, population=6)
    whole = cma_es(values, TWO, options, seed=1)
    file = tmp_path / "state.json"
    with pytest.raises(KeyboardInterrupt):
        cma_es(killed(values, 7), TWO, options, seed=1, checkpoint=file)
    counted = []
    resumed = cma_es(
        lambda v: counted.append(1) or values(v), TWO, options, seed=1, checkpoint=file
    )
    assert len(counted) == 13
    assert resumed.history == whole.history
    np.testing.assert_array_equal(resumed.vector, whole.vector)
    with pytest.raises(UsageError, match="belongs to a search with other"):
        cma_es(values, TWO, options, seed=2, checkpoint=file)


def test_a_killed_search_by_shares_resumes_exactly(tmp_path):
    options = CmaOptions(20, population=6)
    whole = cma_es(sum_of_shares, TWO, options, seed=1, shares=SHARES)
    file = tmp_path / "state.json"
    broken = [killed(share, 2) for share in SHARES]
    with pytest.raises(KeyboardInterrupt):
        cma_es(sum_of_shares, TWO, options, seed=1, shares=broken, checkpoint=file)
    resumed = cma_es(sum_of_shares, TWO, options, seed=1, shares=SHARES, checkpoint=file)
    assert resumed.history == whole.history
    np.testing.assert_array_equal(resumed.vector, whole.vector)


def test_a_killed_least_squares_resumes_exactly(tmp_path):
    def curved(vectors):
        return np.concatenate([bowl(vectors), 0.5 * np.sin(3 * vectors)], axis=1)

    options = LeastSquaresOptions(rounds=5, evaluations=2, tolerance=-1.0)
    whole = least_squares(curved, TWO, options)
    file = tmp_path / "state.json"
    with pytest.raises(KeyboardInterrupt):
        least_squares(killed(curved, 7), TWO, options, checkpoint=file)
    assert file.exists()
    resumed = least_squares(curved, TWO, options, checkpoint=file)
    np.testing.assert_array_equal(resumed.vector, whole.vector)
    assert resumed.history == whole.history


def test_a_foreign_checkpoint_is_refused(tmp_path):
    file = tmp_path / "state.json"
    file.write_text("[]")
    with pytest.raises(UsageError, match="no checkpoint"):
        least_squares(bowl, TWO, checkpoint=file)
    assert file.read_text() == "[]"


def test_many_starts_return_the_best_first():
    low, high = TWO.bounds
    seen = []

    def search(number, start):
        seen.append(start)
        return Found(start, float(np.sum(start**2)), 1, [])

    found = multi_start(search, TWO, 5, seed=0)
    assert [f.cost for f in found] == sorted(f.cost for f in found)
    assert all((low <= s).all() and (s <= high).all() for s in seen)
    np.testing.assert_array_equal(seen[0], [0.0, 0.0])


def test_differences_stay_inside_the_bounds():
    low, high = TWO.bounds
    seen = []
    slopes = jacobian(lambda v: seen.append(v) or bowl(v), low, (low, high), 1e-3)
    assert (np.concatenate(seen) >= low).all()
    np.testing.assert_allclose(slopes, np.array([[2.0, 0.3], [0.1, 1.0]]).T, rtol=1e-6)


def test_only_the_sum_of_armature_and_inertia_is_identifiable():
    run = record(CAD.replace(TRUTH).robot, swing(1.0))
    parameters = choose(CAD.replace(TRUTH), ["hip.friction", "hip.armature", "thigh.inertia"])
    goal = objective(parameters, recordings=[run])
    noise = np.random.default_rng(0).normal(size=goal.cost.size)
    slopes = jacobian(goal.residuals, np.zeros(3), parameters.bounds, 1e-3)
    told = identifiability(parameters, np.zeros(3), noise, slopes)
    assert abs(told.correlation[1, 2]) > 0.99
    assert any("hip.armature" in s and "thigh.inertia" in s for s in told.statements)
    assert not any("hip.friction" in s for s in told.statements)


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    slopes = rng.normal(size=(200, 2))
    covered = 0
    for _ in range(300):
        noise = rng.normal(size=200)
        vector = np.linalg.lstsq(slopes, noise, rcond=None)[0]
        told = identifiability(TWO, vector, noise - slopes @ vector, slopes)
        covered += int((np.abs(told.values - TWO.start) <= told.half_width).sum())
    assert 0.91 < covered / 600 < 0.99


def test_what_the_data_do_not_touch_is_said():
    slopes = np.zeros((50, 2))
    slopes[:, 0] = 1.0
    told = identifiability(TWO, np.ones(2), np.random.default_rng(0).normal(size=50), slopes)
    assert told.half_width[1] == np.inf
    assert "These data say nothing about 'knee.friction'." in told.statements


def test_the_second_pass_stays_near_the_first():
    def search(name, parameters):
        names.append((name, parameters))
        shift = 1.0 if name == "first" else 0.0
        return Found(np.clip(np.full(len(parameters.names), shift), *parameters.bounds), 1.0, 1, [])

    names = []
    result = two_pass(CAD, ["fixed-base", "rail"], search)
    (_, first), (_, second) = names
    assert "thigh.inertia" not in first.names
    assert {"thigh.inertia", "contact.time_constant", "rail.damping"} <= set(second.names)
    found = dict(zip(first.names, first.values(result.first.vector), strict=True))
    for p in second.parameters:
        if p.name in found:
            assert p.start == pytest.approx(found[p.name])
            assert p.low == 0 or p.low >= 0.49 * p.start - p.scale
    assert result.best.get("hip.damping") == pytest.approx(found["hip.damping"])


def test_the_height_of_the_base_tells_of_the_rail():
    truth = CAD.replace({"rail.friction": 2.0})
    air, ground = record(truth.robot, swing(1.0)), record(truth.robot, swing(2.0, "rail"), "rail")
    simulator = WindowSimulator([air, ground], cut([air, ground], 0.1), timestep=STEP)
    cost = Cost(simulator, Scoring(position=None, height=1e-3))
    assert cost.size == 20 * 19
    at_truth, beside = cost.values([truth, truth.replace({"rail.friction": 0.5})])
    assert at_truth < 0.01 * beside
    with pytest.raises(RecordingError, match="record height"):
        Cost(WindowSimulator([air], cut([air], 0.1), timestep=STEP), Scoring(None, height=1e-3))


def test_a_recording_that_the_model_cannot_explain_hardly_moves_the_estimate():
    weak = record(
        CAD.replace({**TRUTH, "knee.motor.torque_limit": 0.3}).robot, swing(2.0, phase=1.0)
    )
    parameters = choose(CAD, list(TRUTH))

    def errors(scoring):
        goal = objective(parameters, scoring, [RUN, weak])
        found = least_squares(goal.residuals, parameters, levels=goal.levels)
        return np.abs(parameters.values(found.vector) / list(TRUTH.values()) - 1)

    assert errors(SCORING).max() > 0.5
    assert errors(dataclasses.replace(SCORING, unexplained=1.0)).max() < 0.02


def test_a_window_counts_in_full_below_the_level_and_the_same_far_beyond():
    simulator = WindowSimulator([RUN], cut([RUN], 0.5), timestep=STEP)
    cost = Cost(simulator, Scoring(0.1, unexplained=0.5))
    plain = cost.residuals([CAD])[0]
    squares = np.square(plain).sum()
    assert cost.levels.cost(1e-4 * plain) == pytest.approx(1e-8 * squares, rel=1e-3)
    assert cost.levels.cost(1e5 * plain) == pytest.approx(plain.size, rel=1e-3)
    weighted = cost.levels.weights(plain) * plain
    rest = cost.levels.rest(plain)
    expected = np.square(plain.reshape(4, -1, 2)).mean(axis=1)
    expected = (1 - 1 / np.sqrt(1 + expected / 0.5)).sum() * plain.size / 8
    assert np.sum(weighted**2) + np.sum(rest**2) == pytest.approx(expected, rel=1e-12)


def test_steps_follow_the_slope_of_the_levelled_cost():
    goal = objective(TWO, dataclasses.replace(SCORING, unexplained=1.0))
    vector, shift = np.array([0.5, -0.5]), 1e-4 * np.eye(2)
    residuals = goal.residuals(vector[None])[0]
    weights = goal.levels.weights(residuals)
    assert weights.min() < 0.1
    slopes = jacobian(goal.residuals, vector, TWO.bounds, 1e-4)
    expected = (goal(vector + shift) - goal(vector - shift)) / 2e-4
    np.testing.assert_allclose(2 * (weights**2 * residuals) @ slopes, expected, rtol=1e-3)
