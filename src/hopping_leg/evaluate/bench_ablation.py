"""What each part of the fast recipe is worth: the recipe with one part taken away at a time."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hopping_leg.evaluate.bench_training import bench_training
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.learn.fast import FastRecipe
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Ablation:
    """A variant of the recipe.

    Attributes:
        name: Of its folder.
        meaning: What is different, in words.
        recipe: The variant.
    """

    name: str
    meaning: str
    recipe: FastRecipe


def ablations(base: FastRecipe) -> list[Ablation]:
    """Return the recipe and its variants, each with one change."""
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
            replace(base, noise_hold=0, log_std=(first + _LATENT, last + _LATENT)),
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
            replace(base, task=replace(task, start="standing")),
        ),
        Ablation(
            "coarse-physics",
            "physics at 2.5 ms in training",
            replace(base, task=replace(task, timestep=2.5e-3)),
        ),
    ]


_LATENT = 1.6
"""Log norm of the actor's last layer early in training: gSDE's noise over its weights' noise."""


def bench_ablation(
    robot: Robot,
    out: Path,
    *,
    steps: int,
    training_seeds: Sequence[int] = (0,),
    evaluation_seeds: int = 5,
    threads: int = 2,
    on_progress: Callable[[str], None] = lambda _note: None,
) -> dict[str, Any]:
    """Train all variants for the same number of steps and judge them.

    Args:
        robot: The leg.
        out: Folder of the runs.
        steps: Control steps of experience of each.
        training_seeds: Of the trainings.
        evaluation_seeds: Realisations of noise and delay per command.
        threads: Of torch and physics.
        on_progress: Called with a sentence on what begins.
    """
    base = replace(FastRecipe(), steps=steps, judge_every=max(1, steps // 5))
    rows = []
    for ablation in ablations(base):
        result = bench_training(
            ablation.recipe,
            robot,
            out / ablation.name,
            training_seeds=training_seeds,
            evaluation_seeds=evaluation_seeds,
            threads=threads,
            on_progress=functools.partial(_named, on_progress, ablation.name),
        )
        rows += [
            {"variant": ablation.name, "meaning": ablation.meaning, **row} for row in result["rows"]
        ]
    return {
        "robot": robot.name,
        "steps": steps,
        "threads": threads,
        "evaluation_seeds": evaluation_seeds,
        "rows": rows,
        "versions": software_versions(),
    }


def _named(on_progress: Callable[[str], None], name: str, note: str) -> None:
    on_progress(f"{name}: {note}")
