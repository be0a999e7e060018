import numpy as np

from hopping_leg.controllers.energy_shaping.observer import DatedObserver, LatestObserver
from hopping_leg.sim.channel import Channel, NoiseAndDelay

PERIOD = 0.005


def errors(disturbance, gain, observer=None, ticks=400, count=50, seed=3):
    """Follow a swinging joint through a channel; return position and velocity errors."""
    channel = Channel(count, disturbance, PERIOD, np.random.default_rng(seed))
    observer = observer or DatedObserver(PERIOD, gain)
    observer.reset(count)
    found = []
    for tick in range(ticks):
        q, qd = swing(tick * PERIOD, count)
        if tick == 0:
            channel.restart(slice(None), q, qd, np.zeros(count))
        state = observer.update(channel.sense(q, qd, np.zeros(count)))
        channel.actuate(np.zeros((count, 2)))
        if tick > 100:
            found.append((state.q - q, state.qd - qd))
    return [np.array(e) for e in zip(*found, strict=True)]


def swing(time, count):
    phase = 2 * np.pi * 1.5 * time + np.linspace(0, 6, count)
    q = np.stack([0.7 + 0.3 * np.sin(phase), -1.4 + 0.6 * np.sin(phase)], axis=-1)
    rate = 2 * np.pi * 1.5 * np.cos(phase)
    return q, np.stack([0.3 * rate, 0.6 * rate], axis=-1)


def test_undisturbed_state_passes_through():
    q, qd = errors(NoiseAndDelay(0.0, 0.0, 0.0), gain=0.1)
    assert np.abs(q).max() < 1e-3
    assert np.abs(qd).max() < 1e-12


def test_noise_of_positions_is_reduced_at_least_threefold():
    noisy = NoiseAndDelay(delay_probability=0.0)
    filtered, _ = errors(noisy, gain=0.06)
    raw, _ = errors(noisy, gain=0.06, observer=LatestObserver())
    assert filtered.std() < raw.std() / 3


def test_late_samples_do_not_make_the_state_late():
    late = NoiseAndDelay(0.0, 0.0, 0.5)
    dated, _ = errors(late, gain=0.1)
    latest, _ = errors(late, gain=0.1, observer=LatestObserver())
    assert np.abs(dated).mean() < 0.25 * np.abs(latest).mean()


def test_gain_may_differ_between_legs():
    noisy = NoiseAndDelay(delay_probability=0.0)
    gains = np.where(np.arange(50) < 25, 0.05, 1.0)
    q, _ = errors(noisy, gain=gains)
    assert q[:, :25].std() < 0.5 * q[:, 25:].std()
