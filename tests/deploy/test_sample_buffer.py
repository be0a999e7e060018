import numpy as np
import pytest

from hopping_leg.deploy.drive_link import Reply
from hopping_leg.deploy.sample_buffer import SampleBuffer


def reply(position):
    return Reply(position, 10 * position, 0.0, 10, 0, 24.0, 30.0, 0.0)


def test_a_late_reply_is_put_where_it_belongs():
    samples = SampleBuffer(0.005)
    for tick in range(5):
        samples.put(tick, 0, reply(tick))
        if tick != 3:
            samples.put(tick, 1, reply(-tick))
    seen = samples.measurement(4, 0.3)
    np.testing.assert_allclose(seen.age[0], [0, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0, :, 0], [4, 2, 1])
    samples.put(3, 1, reply(-3))
    seen = samples.measurement(5, 0.25)
    np.testing.assert_allclose(seen.age[0], [0.005, 0.010, 0.015])
    np.testing.assert_allclose(seen.q[0], [[4, -4], [3, -3], [2, -2]])
    np.testing.assert_allclose(seen.qd, 10 * seen.q)
    np.testing.assert_allclose(seen.command[0], [0.3, 0.25, 0.25])


def test_one_sample_stands_for_the_past_and_none_is_an_error():
    samples = SampleBuffer(0.005)
    with pytest.raises(ValueError, match="both joints"):
        samples.measurement(0, 0.3)
    samples.put(0, 0, reply(1))
    assert not samples.complete()
    samples.put(0, 1, reply(2))
    seen = samples.measurement(0, 0.3)
    assert seen.q.shape == seen.qd.shape == (1, 3, 2)
    np.testing.assert_allclose(seen.q[0], [[1, 2]] * 3)
