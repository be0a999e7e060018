"""Dated samples: late ones find their place, whatever the order of arrival."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.controllers.observation_history import Dated
from hopping_leg.controllers.sample_history import DatedObserver, SampleHistory
from hopping_leg.sim.channel import Channel, NoiseAndDelay

PERIOD = 0.005
LATE = NoiseAndDelay(joint_noise=0.0, torque_noise=0.0)


def measurements(ticks, count=4, seed=0, disturbance=LATE):
    """Yield (tick, measurement) of joints whose position tells the tick, through a channel."""
    channel = Channel(count, disturbance, PERIOD, np.random.default_rng(seed))
    for tick in range(ticks):
        q = np.tile([tick, -tick], (count, 1)).astype(float)
        if tick == 0:
            channel.restart(slice(None), q, q, np.full(count, 0.3))
        yield tick, channel.measurement(channel.samples(q, 10 * q, np.full(count, 0.3)))
        channel.actuate(np.zeros((count, 2)))


@given(seed=st.integers(0, 2**32 - 1))
def test_every_known_sample_stands_at_its_tick(seed):
    track = SampleHistory(15, PERIOD)
    track.reset(4)
    for tick, measurement in measurements(40, seed=seed):
        if tick == 0:
            track.fill(slice(None), measurement)
            continue
        track.shift()
        track.insert(measurement)
        expected = np.maximum(tick - np.arange(15), 0)[:, None] * np.ones(4)
        np.testing.assert_array_equal(track.q[..., 0][track.known], expected[track.known])
        np.testing.assert_array_equal(track.qd[..., 1][track.known], -10 * expected[track.known])


@pytest.fixture
def layout():
    layout = Dated(PERIOD)
    layout.reset(4)
    return layout


@pytest.mark.parametrize("delays", [0.0, 0.5])
def test_samples_have_their_age_and_without_delay_the_lags_are_exact(layout, delays):
    disturbance = NoiseAndDelay(0.0, 0.0, delays)
    for tick, measurement in measurements(40, disturbance=disturbance):
        layout.update(measurement, np.full((4, 2), tick - 1.0))
        inputs = layout.inputs()
        newest = inputs["q"][:, 0, 0]
        if not delays:
            expected = np.maximum(tick - np.array(Dated.LAGS), 0)
            np.testing.assert_array_equal(inputs["q"][:, :, 0], np.tile(expected, (4, 1)))
        if tick > 10:
            np.testing.assert_allclose(inputs["age"][:, 0], (tick - newest) * PERIOD, atol=1e-6)
            torque = tick - 1.0 - np.array(Dated.TORQUE_LAGS)
            np.testing.assert_array_equal(inputs["past_torque"][0, :, 0], torque)


def test_a_restarted_leg_forgets_and_the_others_do_not(layout):
    rows, others = [0, 3], [1, 2]
    for _, measurement in measurements(30):
        layout.update(measurement, np.ones((4, 2)))
    before = layout.inputs()
    layout.restart(np.array(rows), measurement)
    after = layout.inputs()
    for name in before:
        np.testing.assert_array_equal(before[name][others], after[name][others])
    assert (after["q"][rows, -1] == measurement.q[rows, 0]).all()
    assert not after["past_torque"][rows].any()


def errors(disturbance, gain, ticks=400, count=50, seed=3):
    """Follow a swinging joint through a channel; return errors of q and of the newest q."""
    channel = Channel(count, disturbance, PERIOD, np.random.default_rng(seed))
    observer = DatedObserver(PERIOD, gain)
    observer.reset(count)
    found = []
    for tick in range(ticks):
        q, qd = swing(tick * PERIOD, count)
        if tick == 0:
            channel.restart(slice(None), q, qd, np.zeros(count))
        measurement = channel.measurement(channel.samples(q, qd, np.zeros(count)))
        estimate = observer.update(measurement)
        channel.actuate(np.zeros((count, 2)))
        if tick > 100:
            found.append((estimate[0] - q, measurement.q[:, 0] - q))
    return [np.array(e) for e in zip(*found, strict=True)]


def swing(time, count):
    phase = 2 * np.pi * 1.5 * time + np.linspace(0, 6, count)
    q = np.stack([0.7 + 0.3 * np.sin(phase), -1.4 + 0.6 * np.sin(phase)], axis=-1)
    rate = 2 * np.pi * 1.5 * np.cos(phase)
    return q, np.stack([0.3 * rate, 0.6 * rate], axis=-1)


def test_late_samples_do_not_make_the_state_late():
    dated, latest = errors(NoiseAndDelay(0.0, 0.0, 0.5), gain=0.1)
    assert np.abs(dated).mean() < 0.25 * np.abs(latest).mean()


def test_noise_of_positions_is_reduced_by_each_leg_s_gain():
    gains = np.where(np.arange(50) < 25, 0.06, 1.0)
    q, raw = errors(NoiseAndDelay(delay_probability=0.0), gain=gains)
    assert q[:, :25].std() < raw.std() / 3
    assert q[:, :25].std() < 0.5 * q[:, 25:].std()
