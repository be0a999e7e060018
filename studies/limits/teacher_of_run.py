"""The teacher of a run on disk."""

import json
from pathlib import Path

from hopping_leg.errors import UsageError
from hopping_leg.rl.checkpoint import list_checkpoints, read_checkpoint
from hopping_leg.rl.distillation.distillation import make_teacher
from hopping_leg.rl.distillation.teacher import Teacher
from hopping_leg.rl.legacy_names import upgrade_config
from hopping_leg.rl.recipes import recipe_of
from hopping_leg.rl.resumable import restore_learner
from hopping_leg.robot.parameters import Robot


def teacher_of_run(run: Path, robot: Robot) -> Teacher:
    """Return the teacher as the newest checkpoint of a run has it.

    Args:
        run: Folder of a run of ``precise`` or of a recipe made of it.
        robot: The leg that it was trained on.

    Raises:
        UsageError: The run has no teacher, no checkpoint, or another robot.
    """
    file = run / "config.json"
    found = list_checkpoints(run / "checkpoints")
    if not file.exists() or not found:
        raise UsageError(f"{run} holds no run with a checkpoint; train one with `hop train`.")
    config = upgrade_config(json.loads(file.read_text(encoding="utf-8")))
    recipe = recipe_of(config["recipe"], config["options"]).fit(robot)
    if recipe.distillation is None:
        raise UsageError(
            f"The run in {run} is of recipe '{recipe.name}', which has no teacher; take one of"
            " 'precise' or 'adaptive'."
        )
    if config["robot_digest"] != robot.digest:
        raise UsageError(
            f"The run in {run} was trained on {config['robot']}, not on this {robot.name}; give the"
            " robot that it was trained on."
        )
    model = recipe.make_model(recipe.make_env(robot, config["seed"]), config["seed"])
    restore_learner(model, read_checkpoint(found[-1])["model"])
    return make_teacher(model.policy, robot, recipe.task)
