import numpy as np

from hopping_leg.identify.recording import make_recording
from hopping_leg.identify.states import full_states, start_states
from tests.identify.twin import LEG, record, swing

RUN = record(LEG, swing(3.0))
FAST = record(LEG, np.repeat(swing(2.0), 3, axis=0), rate=500.0)


def noisy(run, seed=0):
    """Return the run as seen by poor sensors."""
    rng = np.random.default_rng(seed)
    columns = {"position_rad": 1e-4, "velocity_rad_s": 0.1}
    table = run.trace.table.with_columns(
        run.trace.table[f"{joint}_{name}"] + rng.normal(scale=scale, size=len(run))
        for joint in ("hip", "knee")
        for name, scale in columns.items()
    )
    return make_recording(table, run.setup, "noisy")


def test_states_start_from_what_was_measured():
    for states in (full_states, start_states):
        position, velocity = states(RUN)
        np.testing.assert_array_equal(position, RUN.array("position"))
        np.testing.assert_array_equal(velocity, RUN.array("velocity"))


def test_clean_sensors_are_believed():
    np.testing.assert_array_equal(start_states(FAST)[1], FAST.array("velocity"))


def test_smoothing_comes_nearer_to_the_truth():
    position, velocity = start_states(noisy(FAST))
    error = np.std(velocity - FAST.array("velocity"), axis=0)
    assert (error < 0.05).all()
    assert np.abs(position - FAST.array("position")).max() < 1e-3
