"""The teacher of a finished run as a controller: what feedback of the full state comes to."""

import hashlib
import json
from pathlib import Path

import numpy as np
import torch

from hopping_leg.arrays import Array
from hopping_leg.env.observation import sample_scaling
from hopping_leg.env.true_state import PRIVILEGED, true_state
from hopping_leg.errors import UsageError
from hopping_leg.learn.checkpoint import list_checkpoints, read_checkpoint
from hopping_leg.learn.precise import PreciseRecipe
from hopping_leg.learn.recipes import recipe_of
from hopping_leg.learn.resumable import restore_learner
from hopping_leg.learn.scale import fit
from hopping_leg.learn.taught import TaughtPolicy
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import AnyLegs, Measurement


class Teacher:
    """Sees the true state of simulated legs, without noise or delay; its torques are disturbed.

    Args:
        run: Folder of a run of ``precise`` or of a recipe made of it.
        robot: The leg that it was trained on.

    Raises:
        UsageError: The run has no teacher, no checkpoint, or another robot.
    """

    name = "true-state"

    def __init__(self, run: Path, robot: Robot) -> None:
        self._recipe, self._policy = _load(run, robot)
        self._sample = sample_scaling(robot, self._recipe.task)
        self._torque = np.array(self._recipe.task.action_torque)

    @property
    def digest(self) -> str:
        """First 16 hex digits of its weights' SHA-256."""
        weights = hashlib.sha256()
        for value in self._policy.state_dict().values():
            weights.update(value.numpy().tobytes())
        return weights.hexdigest()[:16]

    @property
    def command_range(self) -> tuple[float, float]:
        """Heights it was made for, m."""
        return self._recipe.task.command_bounds

    def watch(self, legs: AnyLegs) -> None:
        """Take the legs whose state it sees."""
        self._legs = legs

    def reset(self, count: int) -> None:
        """Forget its last action."""
        self._last = np.zeros((count, 2))

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2)."""
        seen = np.zeros((len(self._last), self._policy.features_dim), np.float32)
        first = self._policy.measured
        seen[:, self._recipe.last_torque] = self._last
        told = measurement.command[:, 0]
        true_state(self._legs, told, self._sample, out=seen[:, first : first + PRIVILEGED])
        with torch.no_grad():
            self._last = self._policy.teacher_action(torch.from_numpy(seen)).double().numpy()
        torque: Array = self._last * self._torque
        return torque

    def internals(self) -> dict[str, Array]:
        """Return nothing."""
        return {}


def _load(run: Path, robot: Robot) -> tuple[PreciseRecipe, TaughtPolicy]:
    file = run / "config.json"
    found = list_checkpoints(run / "checkpoints")
    if not file.exists() or not found:
        raise UsageError(f"{run} holds no run with a checkpoint; train one with `hop train`.")
    config = json.loads(file.read_text(encoding="utf-8"))
    recipe = fit(recipe_of(config["recipe"], config["options"]), robot)
    if not isinstance(recipe, PreciseRecipe):
        raise UsageError(
            f"The run in {run} is of recipe '{recipe.name}', which has no teacher; take one of"
            " 'precise', 'adaptive' or 'recurrent'."
        )
    if config["robot_digest"] != robot.digest:
        raise UsageError(
            f"The run in {run} was trained on {config['robot']}, not on this {robot.name}; give the"
            " robot that it was trained on."
        )
    model = recipe.make_model(recipe.make_env(robot, config["seed"]), config["seed"])
    restore_learner(model, read_checkpoint(found[-1])["model"])
    return recipe, model.policy
