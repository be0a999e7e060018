"""Runs of version 0.1: what their configurations and checkpoints called things; goes at 1.0."""

from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.io import replace_at
from hopping_leg.rl.checkpoint import Tree

_PARTS = {
    "schedule": "legs=num_envs steps log_every checkpoint_seconds",
    "selection": "judge_every=eval_every judge_from=eval_start judge_commands=eval_commands",
    "algorithm": "learning_rate rollout=n_steps batch=batch_size epochs=n_epochs gamma gae_lambda"
    " noise_hold=sde_sample_freq log_std quiet_from=log_std_until buffer=buffer_size"
    " warmup=learning_starts returns=n_steps tau gradient_steps target_entropy",
    "network": "actor critic privileged_critic",
    "distillation": "teaching=teacher_share teachers passing=teacher_accept_score"
    " erring=teacher_action_noise guided=dagger_mixing_share alike=nominal_share"
    " draws=randomizations trusting=estimate_ramp",
    "distillation.student": "student=hidden memory=size feeling=error_hidden",
    "task": "task.start=reset_distribution task.stagger=random_episode_start"
    " task.command_hold=command_resampling_time task.chance=randomize_probability"
    " task.unchanged=nominal_fraction",
    "distillation.dagger": "imitation.memory=buffer_size imitation.updates=gradient_steps"
    " imitation.batch=batch_size imitation.knots=knots imitation.aiming=correction_rate",
}
_NAMES = {
    old: f"{part}.{new or old}"
    for part, entries in _PARTS.items()
    for old, _, new in (entry.partition("=") for entry in entries.split())
}
_GONE = {"exam_at": [1.0], "task.idle": 0.0}
"""Options that are gone, with the only values that can still be had."""
_MEMORY = {"recurrent": "gru", "adaptive": "integrator"}


def upgrade_config(stored: dict[str, Any]) -> dict[str, Any]:
    """Return a run's ``config.json`` with the names of today; ``UsageError`` for what is gone."""
    old, recipe = stored.get("options", {}), stored.get("recipe")
    if not old or "schedule" in old:
        return stored
    parts = {k: v for k, v in old.items() if isinstance(v, dict) and k != "reward"}
    flat = {k: v for k, v in old.items() if k not in parts}
    flat |= {f"{part}.{name}": value for part, v in parts.items() for name, value in v.items()}
    names = _NAMES | ({"rollout": "algorithm.train_freq"} if recipe == "paper" else {})
    new: dict[str, Any] = {} if "teaching" in flat else {"distillation": None}
    for name, value in flat.items():
        if name in _GONE:
            if value != _GONE[name]:
                raise UsageError(f"The run has {name} = {value}, which can no longer be trained.")
        elif name == "hidden":
            new["network"] = {**new.get("network", {}), "actor": value, "critic": value}
        elif name == "task.alike_at_first":
            new = replace_at(new, "task.randomize_from_start", not value)
        else:
            path = names.get(name, name.replace("aiming.", "distillation.integrator.", 1))
            new = replace_at(new, path, value)
    if recipe in _MEMORY:
        new = replace_at(new, "distillation.student.memory", _MEMORY[recipe])
    recipe = "precise" if recipe == "recurrent" else recipe
    seeds = stored.get("number_of_starts", 1)
    return {**stored, "recipe": recipe, "options": new, "parallel_seeds": seeds}


def upgrade_checkpoint(tree: Tree) -> Tree:
    """Return a run's checkpoint with the names of today."""
    own = tree["model"].get("own", {})
    if "exams" in own:
        own["teacher_scores"] = own.pop("exams")
    task = tree["model"].get("env", {}).get("task", {})
    task.pop("hopped", None)
    if set(task.get("reward", {})) == {"air", "since"}:
        task["reward"] = {"apex": task["reward"]}
    return tree
