"""Numbers of a MuJoCo model that differ between simulations or change while they run."""

from collections.abc import Sequence
from operator import attrgetter

import mujoco
import numpy as np
from mujoco import batch

from hopping_leg.arrays import Array, IntArray
from hopping_leg.robot.parameters import Robot


def set_model_fields(simulation: batch.Batch, models: Sequence[mujoco.MjModel]) -> None:
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


class JointFriction:
    """Sets MuJoCo's friction loss, whose solver holds a joint at rest.

    Args:
        robots: The leg of each simulation, n of them.
        simulation: The legs.
        joints: Degrees of freedom of hip and knee, (2,).
    """

    def __init__(self, robots: Sequence[Robot], simulation: batch.Batch, joints: IntArray) -> None:
        self._coulomb, self._load = (
            np.array([robot.of_joints(name) for robot in robots])
            for name in ("friction", "load_friction")
        )
        self._joints, self._loss = joints, simulation.expand("dof_frictionloss")

    def set(self, torque: Array, further: Array | float = 0.0) -> None:
        """Set the friction of the joints.

        Args:
            torque: That the motors give, N m at the joints, (n, 2).
            further: Friction beside Coulomb's and the load's, N m, (n, 2).
        """
        self._loss[:, self._joints] = self._coulomb + self._load * np.abs(torque) + further


def friction_grows_with_load(robots: Sequence[Robot]) -> bool:
    """Tell whether any leg's friction grows with load."""
    return any(robot.of_joints("load_friction").any() for robot in robots)
