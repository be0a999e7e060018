"""Where a teacher aims."""

import numpy as np
import pytest
import torch

from hopping_leg.rl.distillation.teacher_student import CommandCorrection


def aim():
    return CommandCorrection(offset=0.31, gain=1 / 0.11, knots=8)


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
