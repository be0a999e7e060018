"""Students: what they are shown, what a memory is, and that it can be learnt."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch.nn import functional

from hopping_leg.rl.students import LabelledRollout, RolloutBuffer, StudentConfig

LEGS, TICKS, SIZE, UNSEEN = 5, 8, 2, 3


def student(every=1):
    torch.manual_seed(0)
    config = StudentConfig("gru", hidden=(8,), size=8, update_every=every)
    return config.make(SimpleNamespace(size=SIZE, command_direction=np.zeros(SIZE)), UNSEEN)


def held(one, rollouts=2):
    return RolloutBuffer(rollouts, TICKS, LEGS, SIZE, one.memory_size, UNSEEN)


def labelled(seen, labels, begun, memory):
    weights, hidden = np.ones(begun.shape), np.zeros((*begun.shape, UNSEEN))
    parts = (part.astype(np.float32) for part in (labels, weights, hidden))
    return LabelledRollout(seen, *parts, begun, memory)


def off(one, buffer, count=TICKS * LEGS):
    """Return the student's mean squared error on what is held."""
    batch, actions, _ = one.recall(buffer, count, torch.Generator().manual_seed(0))
    missed = functional.mse_loss(actions, batch.labels, reduction="none").mean(dim=-1)
    return (missed * batch.weights).sum() / batch.weights.sum()


@pytest.mark.parametrize("every", [1, 4])
def test_learning_sees_what_acting_saw(every):
    """The loss against its own actions is zero, whatever it remembered before the rollout."""
    one, rng = student(every), np.random.default_rng(0)
    buffer, memory = held(one), torch.zeros(LEGS, one.memory_size)
    for _ in range(2):
        seen = rng.normal(size=(TICKS, LEGS, SIZE)).astype(np.float16).astype(np.float32)
        begun = np.zeros((TICKS, LEGS), bool)
        begun[0, 2] = begun[4, 3] = True
        before, acted = memory.numpy().copy(), []
        with torch.no_grad():
            for now, new in zip(seen, begun, strict=True):
                action, memory = one(
                    torch.from_numpy(now), memory * torch.from_numpy(~new)[:, None]
                )
                acted.append(action.numpy())
        buffer.add(labelled(seen, np.stack(acted), begun, before))
        assert off(one, buffer).item() < 1e-6, "labels are kept in half precision"
    with torch.no_grad():
        one.action.bias += 0.1
    assert off(one, buffer).item() > 1e-3


@pytest.mark.parametrize("every", [1, 2])
def test_a_recurrent_student_learns_to_repeat_what_is_no_longer_seen(every):
    """A number is shown in the first tick of eight only, and asked for in all."""
    rng = np.random.default_rng(0)
    one = student(every)

    def shown_once():
        seen, labels = np.zeros((2, TICKS, LEGS, SIZE), np.float32)
        number = rng.choice([-1.0, 1.0], LEGS)
        seen[0, :, 0], labels[:] = number, number[:, None]
        begun = np.zeros((TICKS, LEGS), bool)
        begun[0] = True
        memory = np.zeros((LEGS, one.memory_size), np.float32)
        return labelled(seen, labels, begun, memory)

    optimizer = torch.optim.Adam(one.parameters(), lr=1e-2)
    for _ in range(300):
        buffer = held(one, rollouts=1)
        buffer.add(shown_once())
        loss = off(one, buffer)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.05


def tagged(number, begun=()):
    """Return a rollout whose observations and labels tell its number and the leg."""
    seen = np.full((TICKS, LEGS, SIZE), number, np.float32)
    seen[..., 1] = np.arange(LEGS)
    starts = np.zeros((TICKS, LEGS), bool)
    for place in begun:
        starts[place] = True
    memory = np.arange(LEGS, dtype=np.float32)[None, :, None] + 1
    return LabelledRollout(seen, seen.copy(), seen[..., 1] + 1, seen[..., :1], starts, memory)


def test_the_oldest_rollouts_make_room():
    buffer, generator = RolloutBuffer(2, TICKS, LEGS, SIZE, 1, 1), torch.Generator()
    for number in range(1, 6):
        buffer.add(tagged(number))
        kept = {float(n) for n in (number - 1, number) if n}
        observations, labels, weights, hidden, _ = buffer.ticks(200, generator)
        assert observations.shape == labels.shape == (200, 2)
        assert set(observations[:, 0].tolist()) == kept
        assert set(observations[:, 1].tolist()) == set(map(float, range(LEGS)))
        assert torch.equal(observations, labels)
        assert torch.equal(weights, observations[:, 1] + 1)
        assert torch.equal(hidden, observations[:, :1])
        sequences = [buffer.sequences(2 * TICKS, generator) for _ in range(20)]
        assert {float(s.observations[0, 0, 0]) for s in sequences} == kept
        assert all(s.observations.shape == (TICKS, 2, 2) for s in sequences)


def test_a_sequence_counts_up_to_a_new_episode_with_its_own_legs_memory():
    """An episode that begins with the sequence remembers nothing."""
    buffer = RolloutBuffer(2, TICKS, LEGS, SIZE, 1, 1)
    buffer.add(tagged(0, begun=[(0, 1), (2, 1)]))
    drawn = buffer.sequences(TICKS * LEGS, torch.Generator())
    for leg, weights, memory in zip(
        drawn.observations[0, :, 1], drawn.weights.T, drawn.memory, strict=True
    ):
        new = leg == 1
        assert weights.tolist() == [2, 2, *[0] * (TICKS - 2)] if new else [leg + 1] * TICKS
        assert memory == (0 if new else leg + 1)
