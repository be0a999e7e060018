import numpy as np
import pytest

from hopping_leg.errors import RecordingError
from hopping_leg.identify.windows import cut, deal, hold_out, part
from tests.identify.twin import LEG, record, swing

RUN = record(LEG, swing(3.0))


def test_windows_tile_a_recording():
    windows = cut([RUN], 0.5)
    rows = [r for w in windows for r in range(w.start, w.start + w.length)]
    assert rows == list(range(len(RUN)))
    (window,) = cut([RUN], unscored=0.1)
    assert (window.start, window.length, window.unscored) == (0, 600, 20)
    with pytest.raises(RecordingError, match="too short for windows of 5 s"):
        cut([RUN], 5.0)


def test_dealt_windows_are_all_there_and_every_share_is_spread_over_them():
    windows = cut([RUN], 0.1)
    shares = deal(windows, 4, np.random.default_rng(0))
    assert sorted((w for share in shares for w in share), key=lambda w: w.start) == windows
    for share in shares:
        assert [w.start // 80 for w in share] == list(range(len(share)))
        assert len({w.start % 80 for w in share}) > 1
    assert [len(share) for share in deal(cut([RUN], 1.0), 9, np.random.default_rng(0))] == [1, 1, 1]


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
    with pytest.raises(RecordingError, match=r"5 s, but 5\.34 s are needed.*--validate"):
        hold_out([record(LEG, swing(5.0))], 4.0, np.random.default_rng(0))


def test_a_part_says_which_seconds_it_is():
    run = part(LONG, 200, 400)
    assert run.name.endswith("1.0-2.0 s")
    np.testing.assert_array_equal(run.array("position"), LONG.array("position")[200:400])
