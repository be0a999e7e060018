import numpy as np

from hopping_leg.controllers.sample_history import DatedObserver
from hopping_leg.sim.channel import Channel, NoiseAndDelay

PERIOD = 0.005


def errors(disturbance, gain, ticks=400, count=50, seed=3):
    """Follow a swinging joint through a channel; return errors of q, qd and the newest q."""
    channel = Channel(count, disturbance, PERIOD, np.random.default_rng(seed))
    observer = DatedObserver(PERIOD, gain)
    observer.reset(count)
    found = []
    for tick in range(ticks):
        q, qd = swing(tick * PERIOD, count)
        if tick == 0:
            channel.restart(slice(None), q, qd, np.zeros(count))
        measurement = channel.sense(q, qd, np.zeros(count))
        estimate = observer.update(measurement)
        channel.actuate(np.zeros((count, 2)))
        if tick > 100:
            found.append((estimate[0] - q, estimate[1] - qd, measurement.q[:, 0] - q))
    return [np.array(e) for e in zip(*found, strict=True)]


def swing(time, count):
    phase = 2 * np.pi * 1.5 * time + np.linspace(0, 6, count)
    q = np.stack([0.7 + 0.3 * np.sin(phase), -1.4 + 0.6 * np.sin(phase)], axis=-1)
    rate = 2 * np.pi * 1.5 * np.cos(phase)
    return q, np.stack([0.3 * rate, 0.6 * rate], axis=-1)


def test_undisturbed_state_passes_through():
    q, qd, _ = errors(NoiseAndDelay(0.0, 0.0, 0.0), gain=0.1)
    assert np.abs(q).max() < 1e-3
    assert np.abs(qd).max() < 1e-12


def test_late_samples_do_not_make_the_state_late():
    dated, _, latest = errors(NoiseAndDelay(0.0, 0.0, 0.5), gain=0.1)
    assert np.abs(dated).mean() < 0.25 * np.abs(latest).mean()


def test_noise_of_positions_is_reduced_by_each_leg_s_gain():
    gains = np.where(np.arange(50) < 25, 0.06, 1.0)
    q, _, raw = errors(NoiseAndDelay(delay_probability=0.0), gain=gains)
    assert q[:, :25].std() < raw.std() / 3
    assert q[:, :25].std() < 0.5 * q[:, 25:].std()
