"""Students: what a memory is, and that it can be learnt."""

import numpy as np
import torch

from hopping_leg.rl.distillation.buffer import LabelledRollout, RolloutBuffer
from hopping_leg.rl.distillation.students import StudentConfig

LEGS, TICKS = 5, 6


def student():
    torch.manual_seed(0)
    return StudentConfig("gru", size=8).make(2)


def test_learning_sees_what_acting_saw():
    """The loss against its own actions is zero, whatever it remembered before the rollout."""
    one, rng = student(), np.random.default_rng(0)
    held = RolloutBuffer(2, TICKS, LEGS, 2, 8)
    memory = torch.zeros(LEGS, 8)
    for _ in range(2):
        seen = rng.normal(size=(TICKS, LEGS, 2)).astype(np.float16).astype(np.float32)
        begun = np.zeros((TICKS, LEGS), bool)
        begun[0, 2] = True
        before, acted = memory.numpy().copy(), []
        with torch.no_grad():
            for now, new in zip(seen, begun, strict=True):
                action, memory = one(
                    torch.from_numpy(now), memory * torch.from_numpy(~new)[:, None]
                )
                acted.append(action.numpy())
        held.add(LabelledRollout(seen, np.stack(acted), begun, before))
        loss = one.loss(held, TICKS * LEGS, torch.Generator().manual_seed(0))
        assert loss.item() < 1e-6, "labels are kept in half precision"
    with torch.no_grad():
        one.readout.bias += 0.1
    assert one.loss(held, TICKS * LEGS, torch.Generator().manual_seed(0)).item() > 1e-3


def test_a_recurrent_student_learns_to_repeat_what_is_no_longer_seen():
    """A number is shown in the first tick of six only, and asked for in all."""
    rng = np.random.default_rng(0)

    def shown_once():
        seen, labels = np.zeros((2, TICKS, LEGS, 2), np.float32)
        number = rng.choice([-1.0, 1.0], LEGS)
        seen[0, :, 0], labels[:] = number, number[:, None]
        begun = np.zeros((TICKS, LEGS), bool)
        begun[0] = True
        return LabelledRollout(seen, labels, begun, np.zeros((LEGS, 8), np.float32))

    one, generator = student(), torch.Generator().manual_seed(0)
    optimizer = torch.optim.Adam(one.parameters(), lr=1e-2)
    for _ in range(300):
        held = RolloutBuffer(1, TICKS, LEGS, 2, one.memory_size)
        held.add(shown_once())
        loss = one.loss(held, TICKS * LEGS, generator)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss.item() < 0.05
