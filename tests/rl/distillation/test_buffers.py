"""What a student has seen: the newest, and sequences with what was remembered before them."""

import numpy as np
import torch

from hopping_leg.rl.distillation.buffers import DaggerBuffer, SequenceBuffer


def test_the_newest_observations_are_kept_and_nothing_else():
    lessons = DaggerBuffer(room=10, size=2)
    for number in range(1, 6):
        lessons.add(np.full((2, 2, 2), number, np.float32))
    drawn = lessons.draw(500)
    assert drawn.shape == (500, 2)
    assert set(drawn.unique().tolist()) == {3.0, 4.0, 5.0}


def test_before_the_memory_is_full_only_what_was_seen_is_drawn():
    lessons = DaggerBuffer(room=100, size=1)
    lessons.add(np.ones((3, 1, 1), np.float32))
    assert (lessons.draw(50) == 1).all()


def test_the_unknown_is_left_out():
    lessons = DaggerBuffer(room=100, size=1)
    seen = np.tile(np.arange(3, dtype=np.float32)[:, None], (4, 1, 1))
    known = np.ones((4, 3), bool)
    known[:, 1] = False
    lessons.add(seen, known)
    assert set(lessons.draw(200).ravel().tolist()) == {0.0, 2.0}


def test_lessons_go_on_from_their_state():
    first, second = DaggerBuffer(8, 1), DaggerBuffer(8, 1)
    first.add(np.arange(5, dtype=np.float32)[:, None, None])
    second.restore(first.state())
    more = np.arange(10, 16, dtype=np.float32)[:, None, None]
    for lessons in (first, second):
        lessons.add(more)
    np.testing.assert_array_equal(first.state()["seen"], second.state()["seen"])
    assert sorted(first.state()["seen"][:, 0]) == [3, 4, 10, 11, 12, 13, 14, 15]


def rollout(number, ticks=4, num_envs=3):
    seen = np.full((ticks, num_envs, 2), number, np.float32)
    seen[..., 1] = np.arange(num_envs)
    nothing = np.zeros((ticks, num_envs), bool)
    return seen, nothing, ~nothing, torch.arange(3.0)[:, None] + 1


def test_sequences_forget_the_oldest_rollouts():
    lessons = SequenceBuffer(room=30)
    for number in range(5):
        lessons.add(*rollout(number))
    drawn = torch.cat([lessons.draw(12).seen[0, :, 0] for _ in range(50)])
    assert set(drawn.tolist()) == {3.0, 4.0}


def test_a_sequence_comes_with_its_own_legs_memory():
    lessons = SequenceBuffer(room=30)
    lessons.add(*rollout(0))
    drawn = lessons.draw(8)
    assert drawn.seen.shape == (4, 2, 2)
    assert drawn.counts.all()
    assert drawn.memory[:, 0].tolist() == (drawn.seen[0, :, 1] + 1).tolist()


def test_an_episode_that_begins_with_the_sequence_remembers_nothing():
    lessons = SequenceBuffer(room=30)
    seen, begun, known, memory = rollout(0)
    begun[0, 1] = True
    lessons.add(seen, begun, known, memory)
    drawn = lessons.draw(12)
    found = zip(drawn.seen[0, :, 1].tolist(), drawn.memory[:, 0].tolist(), strict=True)
    assert dict(found) == {0: 1, 1: 0, 2: 3}
    assert drawn.counts.all()


def test_a_sequence_counts_up_to_a_new_episode_where_the_answer_is_known():
    lessons = SequenceBuffer(room=30)
    seen, begun, known, memory = rollout(0)
    begun[2, 1] = True
    known[3, 0] = False
    lessons.add(seen, begun, known, memory)
    drawn = lessons.draw(12)
    legs = drawn.seen[0, :, 1].tolist()
    counts = {leg: c.tolist() for leg, c in zip(legs, drawn.counts.T, strict=True)}
    assert counts == {0: [1, 1, 1, 0], 1: [1, 1, 0, 0], 2: [1, 1, 1, 1]}


def test_sequences_go_on_from_their_state():
    first, second = SequenceBuffer(30), SequenceBuffer(30)
    for number in range(2):
        first.add(*rollout(number))
    second.restore(first.state())
    torch.manual_seed(0)
    wanted = first.draw(8)
    torch.manual_seed(0)
    for a, b in zip(wanted, second.draw(8), strict=True):
        assert torch.equal(a, b)
