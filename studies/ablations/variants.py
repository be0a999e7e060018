"""What recipes are made of: each with one part taken away at a time."""

from dataclasses import dataclass, replace

from hopping_leg.rl.recipes.fast import FastRecipe
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.rl.recipes.recurrent import RecurrentRecipe

_LATENT = 1.6
"""Log norm of the actor's last layer early in training: gSDE's noise over its weights' noise."""


@dataclass(frozen=True)
class Ablation:
    """A variant of a recipe.

    Attributes:
        name: Of its folder.
        meaning: What is different, in words.
        recipe: The variant.
    """

    name: str
    meaning: str
    recipe: FastRecipe


def _of_fast() -> list[Ablation]:
    base = FastRecipe()
    task, reward = base.task, base.reward
    first, last = base.log_std
    return [
        Ablation("recipe", "the recipe", base),
        Ablation(
            "three-samples",
            "the paper's three samples, which do not tell their age",
            replace(base, task=replace(task, observation="three-samples")),
        ),
        Ablation(
            "cheap-jerk",
            "a third of the price for jerky actions, the paper's",
            replace(base, reward=replace(reward, jerk=0.05)),
        ),
        Ablation(
            "white-noise",
            "white exploration noise of the same size instead of gSDE",
            replace(base, sde_sample_freq=0, log_std=(first + _LATENT, last + _LATENT)),
        ),
        Ablation(
            "blind-critic",
            "critic on the actor's observation",
            replace(base, privileged_critic=False),
        ),
        Ablation(
            "no-event", "no reward at the apex", replace(base, reward=replace(reward, apex=0))
        ),
        Ablation(
            "no-patience",
            "the apex pays alike however soon it follows the last",
            replace(base, reward=replace(reward, full_period=1e-9)),
        ),
        Ablation(
            "no-prediction",
            "no predicted apex in flight",
            replace(base, reward=replace(reward, predicted=0)),
        ),
        Ablation(
            "standing-starts",
            "every episode starts standing",
            replace(base, task=replace(task, reset_distribution="standing")),
        ),
        Ablation(
            "coarse-physics",
            "physics at 2.5 ms in training",
            replace(base, task=replace(task, timestep=2.5e-3)),
        ),
    ]


def _of_precise() -> list[Ablation]:
    base, fast, recurrent = PreciseRecipe(), FastRecipe(), RecurrentRecipe()
    return [
        Ablation("recipe", "the recipe", base),
        Ablation(
            "one-teacher", "one teacher with all the teachers' time", replace(base, teachers=1)
        ),
        Ablation(
            "all-heights-alike",
            "low commands as often as high ones",
            replace(base, task=replace(base.task, command_skew=1.0)),
        ),
        Ablation(
            "energy-anywhere",
            "the teacher's energy gain is paid at any height, and half as much",
            replace(base, reward=replace(base.reward, energy=0.4, energy_beyond=0.0)),
        ),
        Ablation(
            "four-passes",
            "four passes over a rollout instead of eight",
            replace(base, n_epochs=4),
        ),
        Ablation(
            "no-teacher",
            "no teacher: reinforcement learning on the same inputs, as `fast` learns",
            replace(fast, task=base.task, eval_commands=base.eval_commands),
        ),
        Ablation(
            "short-past",
            "50 ms of dated samples instead of 0.7 s",
            replace(base, task=replace(base.task, observation="dated")),
        ),
        Ablation(
            "recurrent",
            "50 ms and a recurrent unit instead of 0.7 s",
            replace(
                recurrent,
                task=replace(recurrent.task, command_range=base.task.command_range),
                eval_commands=base.eval_commands,
            ),
        ),
        Ablation(
            "jumpy-teacher",
            "a teacher for whom jerky actions cost what they cost `fast`, and torque nothing",
            replace(base, reward=replace(base.reward, jerk=fast.reward.jerk, effort=0.0)),
        ),
        Ablation(
            "no-aim",
            "a teacher that is told the command itself",
            replace(base, dagger=replace(base.dagger, correction_rate=0.0)),
        ),
        Ablation(
            "newest-only",
            "only the newest tenth of the ticks from which the policy learns",
            replace(base, dagger=replace(base.dagger, buffer_size=base.dagger.buffer_size // 10)),
        ),
        Ablation(
            "coarse-physics",
            "physics at 1 ms in training",
            replace(base, task=replace(base.task, timestep=1e-3)),
        ),
    ]


ABLATIONS = {"fast": _of_fast, "precise": _of_precise}
"""By recipe: it and its variants, each with one change."""
