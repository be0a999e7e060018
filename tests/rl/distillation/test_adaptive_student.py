"""The adaptive recipe: its policy feels how far it was off and aims elsewhere."""

import dataclasses

import numpy as np
import pytest
import torch

from hopping_leg.errors import UsageError
from hopping_leg.rl.distillation.adaptive_student import HopErrors
from tests.rl.learners import TINY_ADAPTIVE, learner


@pytest.mark.parametrize("command", [-1.0, -0.4, 1.0])
def test_a_correction_follows_the_true_error_by_its_share_of_every_hop(command):
    model = learner(TINY_ADAPTIVE)
    student = model.policy.student
    places = student._places
    seen = torch.zeros(4, places.size)
    seen[:, [places.command, places.true_command]] = command
    nobody = np.zeros(4, bool)

    def pass_by(height, clearance, ticks):
        seen[:, places.true_height], seen[:, places.true_clearance] = height, clearance
        for _ in range(ticks):
            student.act(seen, nobody)

    pass_by(command - 0.1, 1.0, 40)
    pass_by(command - 0.5, 0.0, 22 + 5)
    shares = np.array([(1 - command) / 2, (1 + command) / 2])
    correction = student._memory[0, :2].numpy() @ shares
    assert correction == pytest.approx(0.1 * TINY_ADAPTIVE.value("integrator.share"), rel=1e-4)


def test_the_teacher_is_asked_at_the_corrected_command():
    model = learner(TINY_ADAPTIVE)
    student = model.policy.student
    places = student._places
    asked = []

    def wanted(rows):
        asked.append(rows[:, places.true_command] - rows[:, places.command])
        return torch.zeros(len(rows), 2)

    seen = np.zeros((30, 4, places.size), np.float32)
    begun = np.zeros((30, 4), bool)
    begun[0] = True
    for row, first in zip(seen, begun, strict=True):
        student.act(torch.from_numpy(row), first)
    student.add_rollout(seen, begun, np.ones_like(begun))
    student.loss(64, wanted)
    corrections = student._memory[:, :2].mean(dim=1)
    assert asked[0].abs().max() > 0
    distance = (asked[0][:, None] - corrections[None]).abs().min(dim=1).values
    assert distance.max() < 1e-3


def test_the_corrections_of_ever_more_legs_follow_the_estimate():
    model = learner(TINY_ADAPTIVE)
    shares = []
    for share in np.linspace(TINY_ADAPTIVE.distillation.teacher_share, 1, 21):
        TINY_ADAPTIVE.anneal(model, model.env, share)
        shares.append(model.policy.student.estimate_share)
    assert shares[0] == 0
    assert shares[-1] == 1
    assert (np.diff(shares) >= 0).all()


def test_legs_are_nominal_until_the_policy_can_act_and_change_from_then_on():
    numbers = [
        TINY_ADAPTIVE.distillation.randomization(student_progress)
        for student_progress in np.linspace(-0.5, 1, 301)
    ]
    nominal = np.linspace(-0.5, 1, 301) < TINY_ADAPTIVE.distillation.nominal_share
    assert not np.array(numbers)[nominal].any()
    later = np.array(numbers)[~nominal]
    assert later[0] == 1
    assert set(np.diff(later)) == {0, 1}
    assert later[-1] == TINY_ADAPTIVE.distillation.randomizations + 1


def test_it_learns_to_estimate_an_error_that_is_among_the_measurements():
    model = learner(TINY_ADAPTIVE)
    student = model.policy.student
    places = student._places
    optimizer = torch.optim.Adam(student.parameters(), lr=1e-2)
    rng = np.random.default_rng(0)
    rows = np.zeros((50, 4, places.size + 3), np.float32)
    rows[..., 0] = rows[..., -1] = rng.uniform(-1, 1, (50, 4))
    student._buffer.add(rows, np.ones(rows.shape[:2], bool))
    for _ in range(300):
        loss = student.loss(64, lambda seen: torch.zeros(len(seen), 2))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.02


def test_an_observation_with_three_commands_is_refused():
    task = dataclasses.replace(TINY_ADAPTIVE.task, observation="three-samples")
    with pytest.raises(UsageError, match="choose --observation dated-long"):
        learner(dataclasses.replace(TINY_ADAPTIVE, task=task))


FLIGHT, STANCE = 40, 30


def step(one, height, gap, command, begun=False):
    """Show one leg for a tick; return the error that counts."""
    shown = (np.array([value]) for value in (height, gap, command, begun))
    return one.update(*shown)[0]


def watch(apexes, commands=None, one=None):
    """Let one leg hop; return the error in every tick of every hop, (hops, ticks)."""
    one = one or HopErrors(1, 0.005)
    errors = []
    for apex, command in zip(apexes, commands or [0.3] * len(apexes), strict=True):
        rise = np.sin(np.linspace(0, np.pi, FLIGHT + 1))
        gap = np.concatenate([0.1 * rise[1:-1], np.zeros(STANCE)])
        height = np.concatenate([0.2 + (apex - 0.2) * rise[1:-1], np.full(STANCE, 0.19)])
        errors.append([step(one, h, g, command) for h, g in zip(height, gap, strict=True)])
    return np.array(errors)


def test_the_last_hops_error_counts_while_the_foot_stands():
    errors = watch([0.31, 0.28])
    landed = FLIGHT - 1
    shown = slice(landed + 6, landed + 22)
    np.testing.assert_allclose(errors[0, shown], 0.01, atol=1e-3)
    np.testing.assert_allclose(errors[1, shown], -0.02, atol=1e-3)
    errors[:, shown] = 0.0
    assert not errors.any()


def test_nothing_counts_once_the_command_has_changed():
    one = HopErrors(1, 0.005)
    watch([0.31], one=one)
    assert watch([0.31], [0.25], one).any()
    for _ in range(FLIGHT):
        step(one, 0.3, 0.1, 0.25)
    assert not any(step(one, 0.2, 0.0, 0.35) for _ in range(STANCE))


@pytest.mark.parametrize("ticks", [1, 10])
def test_a_bounce_is_no_hop(ticks):
    one = HopErrors(1, 0.005)
    for _ in range(ticks):
        step(one, 0.25, 0.01, 0.3)
    assert not any(step(one, 0.2, 0.0, 0.3) for _ in range(40))


def test_a_new_episode_knows_of_no_hop():
    one = HopErrors(1, 0.005)
    for tick in range(FLIGHT):
        step(one, 0.3, 0.1, 0.25, begun=tick == FLIGHT - 1)
    assert not any(step(one, 0.2, 0.0, 0.25) for _ in range(40))
