"""Simulations that each go by a model of their own."""

from collections.abc import Sequence
from operator import attrgetter

import mujoco
import numpy as np
from mujoco import batch


def take_models(simulation: batch.Batch, models: Sequence[mujoco.MjModel]) -> None:
    """Give every simulation the numbers of its model, in its present state.

    They become per-simulation fields, which go on holding what is not written again: unlike whole
    models, single ones of them may then change from step to step (``JointFriction``).

    Args:
        simulation: The legs, n of them.
        models: One per simulation, all compiled from the same parts: what differs is floating
            point.
    """
    shared = simulation.model
    for name in _numbers(shared):
        number = attrgetter(name)
        own = np.stack([number(model) for model in models])
        if simulation.expanded(name) is not None or (own != number(shared)).any():
            simulation.expand(name)[:] = own


def _numbers(model: mujoco.MjModel) -> list[str]:
    """Return the names of all that is floating point and not empty, in alphabetical order."""
    found = []
    for name in sorted(batch.MODEL_FIELDS):
        value = attrgetter(name)(model)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.size:
            found.append(name)
    return found
