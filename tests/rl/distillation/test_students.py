"""Students: what a memory is, and that it can be learnt."""

import numpy as np
import torch
from torch import nn

from hopping_leg.rl.distillation.students import RecurrentStudent, WindowStudent

LEGS, SIZE = 5, 3


def recurrent(room=10_000):
    torch.manual_seed(0)
    return RecurrentStudent(measured=2, memory=8, room=room, legs=LEGS)


def nobody():
    return np.zeros(LEGS, bool)


def test_a_recurrent_student_acts_on_what_came_before():
    student, seen = recurrent(), torch.ones(LEGS, 2)
    first = student.act(seen, nobody())
    assert not torch.allclose(student.act(seen, nobody()), first)


def test_a_new_episode_begins_with_nothing_remembered():
    student, seen = recurrent(), torch.ones(LEGS, 2)
    first = student.act(seen, nobody())
    begun = np.array([True, False, False, False, False])
    second = student.act(seen, begun)
    torch.testing.assert_close(second[0], first[0])
    assert not torch.allclose(second[1:], first[1:])


def test_learning_sees_what_acting_saw():
    """The loss against its own actions is zero, whatever was remembered before the rollout."""
    student = recurrent()
    rng = np.random.default_rng(0)
    for number in range(2):
        seen = rng.normal(size=(6, LEGS, SIZE)).astype(np.float16).astype(np.float32)
        begun = np.zeros((6, LEGS), bool)
        begun[0, 2] = number == 1
        acted = torch.stack(
            [student.act(torch.from_numpy(s[:, :2]), b) for s, b in zip(seen, begun, strict=True)]
        )
        student.add_rollout(seen, begun, np.ones_like(begun))
    student._lessons._rollouts.popleft()

    def wanted(rows):
        places = [np.argwhere((seen == row.numpy()).all(axis=-1))[0] for row in rows]
        return torch.stack([acted[tick, leg] for tick, leg in places]).detach()

    assert student.loss(6 * LEGS, wanted).item() < 1e-10


def test_a_recurrent_student_learns_to_repeat_what_is_no_longer_seen():
    """A number is shown in the first tick of six only, and asked for in all."""
    student = recurrent(room=1)
    optimizer = torch.optim.Adam(student.parameters(), lr=1e-2)
    rng = np.random.default_rng(0)
    for _ in range(300):
        seen = np.zeros((6, LEGS, SIZE), np.float32)
        seen[0, :, 0] = seen[..., 2] = rng.choice([-1.0, 1.0], LEGS)
        begun = np.zeros((6, LEGS), bool)
        begun[0] = True
        student.add_rollout(seen, begun, np.ones_like(begun))
        loss = student.loss(6 * LEGS, lambda rows: rows[:, 2:].expand(-1, 2))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.05


def test_a_window_student_learns_what_it_is_shown_and_sees_measurements_alone():
    torch.manual_seed(0)
    student = WindowStudent(2, SIZE, [16], 1000, nn.Tanh)
    optimizer = torch.optim.Adam(student.parameters(), lr=1e-2)
    student.add_rollout(
        np.random.default_rng(0).uniform(-1, 1, (10, 100, SIZE)).astype(np.float32),
        np.zeros((10, 100), bool),
        np.ones((10, 100), bool),
    )
    losses = {}
    for column in (0, 2):
        for _ in range(200):
            loss = student.loss(64, lambda rows, c=column: rows[:, c : c + 1].expand(-1, 2))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        losses[column] = loss.item()
    assert losses[0] < 0.02
    assert losses[2] > 0.2
