"""Runs of version 0.1: what their configurations and checkpoints called things; goes at 1.0."""

from typing import Any

from hopping_leg import errors, io
from hopping_leg.rl.checkpoint import Tree

_TABLE = """
schedule legs=num_envs steps log_every checkpoint_seconds
selection judge_every=eval_every judge_from=eval_start judge_commands=eval_commands
algorithm learning_rate rollout=n_steps batch=batch_size epochs=n_epochs gamma gae_lambda log_std
algorithm noise_hold=sde_sample_freq quiet_from=log_std_until buffer=buffer_size returns=n_steps
algorithm warmup=learning_starts tau gradient_steps target_entropy
network actor critic privileged_critic
distillation teaching=teacher_share teachers passing=teacher_accept_score alike=nominal_share
distillation erring=teacher_action_noise guided=dagger_mixing_share draws=randomizations
distillation trusting=estimate_ramp
distillation.student student=hidden memory=size feeling=error_hidden
task task.start=reset_distribution task.stagger=random_episode_start task.unchanged=nominal_fraction
task task.command_hold=command_resampling_time task.chance=randomize_probability
distillation.dagger imitation.memory=buffer_size imitation.knots=knots
distillation.dagger imitation.batch=batch_size imitation.aiming=correction_rate
distillation.dagger imitation.updates=gradient_steps
"""
_NAMES = {
    old: f"{part}.{new or old}"
    for part, *entries in map(str.split, _TABLE.strip().splitlines())
    for old, _, new in (entry.partition("=") for entry in entries)
}
_GONE = {"exam_at": [1.0], "task.idle": 0.0}
"""Options that are gone, with the only values that can still be had."""
_MEMORY = {"recurrent": "gru", "adaptive": "integrator"}


def upgrade_config(stored: dict[str, Any]) -> dict[str, Any]:
    """Return a run's ``config.json`` with the names of today; ``UsageError`` for what is gone."""
    old, recipe = stored.get("options", {}), stored.get("recipe")
    if not old or "schedule" in old:
        return stored
    flat: dict[str, Any] = {}
    for k, v in old.items():
        nested = isinstance(v, dict) and k != "reward"
        flat |= {f"{k}.{name}": value for name, value in v.items()} if nested else {k: v}
    names = _NAMES | ({"rollout": "algorithm.train_freq"} if recipe == "paper" else {})
    new: dict[str, Any] = {} if "teaching" in flat else {"distillation": None}
    for name, value in flat.items():
        if name in _GONE:
            if value != _GONE[name]:
                raise errors.UsageError(
                    f"The run has {name} = {value}, which can no longer be trained."
                )
        elif name == "hidden":
            new["network"] = {**new.get("network", {}), "actor": value, "critic": value}
        elif name == "task.alike_at_first":
            new = io.replace_at(new, "task.randomize_from_start", not value)
        else:
            renamed = name.replace("aiming.", "distillation.integrator.", 1)
            new = io.replace_at(new, names.get(name, renamed), value)
    if recipe in _MEMORY:
        new = io.replace_at(new, "distillation.student.memory", _MEMORY[recipe])
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
