"""What a student is shown: the newest ticks, with what the teacher would have done."""

import numpy as np
import torch

from hopping_leg.rl.distillation.buffer import LabelledRollout, RolloutBuffer

TICKS, LEGS = 4, 3


def buffer(rollouts=2):
    return RolloutBuffer(rollouts, TICKS, LEGS, size=2, memory=1, hidden=1)


def rollout(number, begun=()):
    """Return a rollout whose observations and labels tell its number and the leg."""
    seen = np.full((TICKS, LEGS, 2), number, np.float32)
    seen[..., 1] = np.arange(LEGS)
    starts = np.zeros((TICKS, LEGS), bool)
    for place in begun:
        starts[place] = True
    memory = np.arange(LEGS, dtype=np.float32)[:, None] + 1
    weights, hidden = seen[..., 1] + 1, seen[..., :1]
    return LabelledRollout(seen, seen.copy(), weights, hidden, starts, memory)


def draws():
    return torch.Generator().manual_seed(0)


def test_the_oldest_rollouts_make_room():
    held, generator = buffer(), draws()
    for number in range(1, 6):
        held.add(rollout(number))
        kept = {float(n) for n in (number - 1, number) if n}
        observations, labels, weights, hidden, _ = held.ticks(200, generator)
        assert observations.shape == labels.shape == (200, 2)
        assert set(observations[:, 0].tolist()) == kept
        assert set(observations[:, 1].tolist()) == {0.0, 1.0, 2.0}
        assert torch.equal(observations, labels)
        assert torch.equal(weights, observations[:, 1] + 1)
        assert torch.equal(hidden, observations[:, :1])
        sequences = [held.sequences(8, generator) for _ in range(20)]
        assert {float(s.observations[0, 0, 0]) for s in sequences} == kept
        assert all(s.observations.shape == (TICKS, 2, 2) for s in sequences)


def test_a_sequence_counts_up_to_a_new_episode_with_its_own_legs_memory():
    """An episode that begins with the sequence remembers nothing."""
    held = buffer()
    held.add(rollout(0, begun=[(0, 1), (2, 1)]))
    drawn = held.sequences(TICKS * LEGS, draws())
    legs = drawn.observations[0, :, 1].tolist()
    counts = {leg: c.tolist() for leg, c in zip(legs, drawn.weights.T, strict=True)}
    assert counts == {0: [1, 1, 1, 1], 1: [2, 2, 0, 0], 2: [3, 3, 3, 3]}
    assert dict(zip(legs, drawn.memory[:, 0].tolist(), strict=True)) == {0: 1, 1: 0, 2: 3}
