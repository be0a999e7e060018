import numpy as np
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.cost import Cost, Scoring
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import cut
from tests.identify.searches import CAD, RUN
from tests.identify.twin import STEP, record, swing


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
    run = RUN.__class__(RUN.trace.__class__(table), RUN.metadata, "partial")
    both, one = (
        Cost(WindowSimulator([r], cut([r], None), timestep=STEP), Scoring(None, None, 1.0)).size
        for r in (RUN, run)
    )
    assert one == both / 2
    gone = run.__class__(
        run.trace.__class__(table.with_columns(knee_torque_nm=None)), run.metadata, "none"
    )
    simulator = WindowSimulator([gone], cut([gone], None), timestep=STEP)
    with pytest.raises(RecordingError, match="no measured sample"):
        Cost(simulator, Scoring(None, None, 1.0))


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


def test_a_window_counts_in_full_below_the_level_and_the_same_far_beyond():
    simulator = WindowSimulator([RUN], cut([RUN], 0.5), timestep=STEP)
    cost = Cost(simulator, Scoring(0.1, unexplained=0.5))
    plain = cost.residuals([CAD])[0]
    squares = np.square(plain).sum()
    assert cost.loss.cost(1e-4 * plain) == pytest.approx(1e-8 * squares, rel=1e-3)
    assert cost.loss.cost(1e5 * plain) == pytest.approx(plain.size, rel=1e-3)
    weighted = cost.loss.weights(plain) * plain
    rest = cost.loss.rest(plain)
    expected = np.square(plain.reshape(4, -1, 2)).mean(axis=1)
    expected = (1 - 1 / np.sqrt(1 + expected / 0.5)).sum() * plain.size / 8
    assert np.sum(weighted**2) + np.sum(rest**2) == pytest.approx(expected, rel=1e-12)
