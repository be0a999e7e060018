import numpy as np
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.holdout import hold_out, part
from tests.identify.twin import LEG, record, swing

LONG = record(LEG, swing(60.0))


@pytest.mark.parametrize("seed", range(4))
def test_every_fourth_stretch_is_held_out_and_nothing_is_lost(seed):
    fit, held = hold_out([LONG], 2.0, np.random.default_rng(seed))
    times = np.sort(np.concatenate([r.time for r in (*fit, *held)]))
    np.testing.assert_array_equal(times, LONG.time)
    assert sum(map(len, held)) == pytest.approx(0.25 * len(LONG), abs=4)
    gaps = np.diff([r.time[0] for r in held])
    np.testing.assert_allclose(gaps, 20.0, atol=0.02)


def test_a_short_recording_gives_its_last_quarter():
    run = record(LEG, swing(8.0))
    (fit,), (held,) = hold_out([run], 4.0, np.random.default_rng(0))
    assert len(fit) == 3 * len(held)
    assert fit.time[-1] < held.time[0]


def test_what_cannot_be_split_gets_a_sentence():
    with pytest.raises(RecordingError, match=r"5 s, but 5\.34 s are needed.*--validate"):
        hold_out([record(LEG, swing(5.0))], 4.0, np.random.default_rng(0))


def test_a_part_says_which_seconds_it_is():
    run = part(LONG, 200, 400)
    assert run.name.endswith("1.0-2.0 s")
    np.testing.assert_array_equal(run.array("position"), LONG.array("position")[200:400])
