"""What a student has seen, and where its teacher aims."""

import numpy as np
import pytest
import torch

from hopping_leg.learn.imitation import Aim, Lessons


def aim():
    return Aim(offset=0.31, gain=1 / 0.11, knots=8)


def test_the_newest_observations_are_kept_and_nothing_else():
    lessons = Lessons(room=10, size=2)
    for number in range(1, 6):
        lessons.add(np.full((2, 2, 2), number, np.float32))
    drawn = lessons.draw(500)
    assert drawn.shape == (500, 2)
    assert set(drawn.unique().tolist()) == {3.0, 4.0, 5.0}


def test_before_the_memory_is_full_only_what_was_seen_is_drawn():
    lessons = Lessons(room=100, size=1)
    lessons.add(np.ones((3, 1), np.float32))
    assert (lessons.draw(50) == 1).all()


def test_lessons_go_on_from_their_state():
    first, second = Lessons(8, 1), Lessons(8, 1)
    first.add(np.arange(5, dtype=np.float32)[:, None])
    second.restore(first.state())
    more = np.arange(10, 16, dtype=np.float32)[:, None]
    for lessons in (first, second):
        lessons.add(more)
    np.testing.assert_array_equal(first.state()["seen"], second.state()["seen"])
    assert sorted(first.state()["seen"][:, 0]) == [3, 4, 10, 11, 12, 13, 14, 15]


def test_without_errors_the_teacher_is_told_the_command():
    told = torch.linspace(-1, 1, 9)
    untouched = aim()
    untouched.correct(np.zeros(0), np.zeros(0), 0.5)
    torch.testing.assert_close(untouched(told), told)


def test_aiming_takes_an_offset_that_depends_on_height_away():
    rng = np.random.default_rng(0)
    corrected = aim()

    def hop(commands):
        told = corrected(torch.from_numpy((commands - 0.31) / 0.11).float()).numpy() * 0.11 + 0.31
        return told - 0.004 - 0.05 * (told - 0.31) + rng.normal(0, 0.005, len(commands))

    for _ in range(200):
        commands = rng.uniform(0.20, 0.42, 400)
        corrected.correct(commands, hop(commands) - commands, 0.1)
    for command in (0.22, 0.31, 0.40):
        many = np.full(4000, command)
        assert np.mean(hop(many)) == pytest.approx(command, abs=0.001)


def test_a_height_where_nobody_hopped_is_left_alone():
    corrected = aim()
    corrected.correct(np.full(50, 0.20), np.full(50, 0.01), 0.5)
    assert corrected.values[0] < 0
    assert not corrected.values[1:].any()
