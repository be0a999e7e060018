"""Train a controller from scratch, or go on after an interruption.

The run's folder holds TensorBoard logs, checkpoints, snapshots and at the end the selected policy
with its model card. A run that was stopped or killed at any moment goes on with --resume as if
nothing had happened.

Examples:
  hop train --recipe fast --minutes 5
  hop train --recipe rl --robot legv2
  hop train --recipe paper --seed 1 --out runs/mine
  hop train --recipe paper --seed 1 --out runs/mine --resume
  hop evaluate runs/mine/policy.onnx
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hopping_leg.cli import COMMAND
from hopping_leg.cli.options import JsonFile, at_least, save_json, say
from hopping_leg.errors import TraceError
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class Options:
    """What to train and where to keep it."""

    recipe: str = "fast"
    """Recipe: `rl` for reinforcement learning from nothing, `fast` for imitation of a teacher,
    `universal` (or `universal-small`, for a microcontroller) for one policy on any leg, `paper` for
    the paper's method; or FILE.py:NAME, a recipe of your own."""
    robot: str | None = None
    """A shipped robot or the path of a .toml file; default: legv2-paper for `paper`, legv2 for
    `universal`, which is trained on other legs besides, else legv2-identified."""
    seed: int = 0
    """Seed of weights, exploration, starts, noise and delay."""
    out: Path | None = None
    """The run's folder; default: runs/RECIPE-seedSEED."""
    resume: bool = False
    """Continue the run in the folder; start one if there is none."""
    set: tuple[str, ...] = ()
    """Numbers of the recipe to change, e.g. `--set learning_rate=3e-4 reward.jerk=0.2`."""
    randomise: Literal["none", "twins", "surprises"] | None = None
    """What each leg in training draws for itself instead of the recipe's: nothing; friction,
    inertia and ground from the twins' ranges; or whatever may surprise a leg, from a payload to
    late commands."""
    observation: str | None = None
    """Observation history that the policy sees instead of the recipe's, e.g. the paper's
    `three-samples`, or `dated-long`; an unknown name lists all."""
    heights: tuple[float, float] | None = None
    """Lowest and highest command, m, instead of the recipe's."""
    minutes: float | None = None
    """Wall-clock time from the first rollout on; default: when the recipe's steps are done."""
    steps: int | None = None
    """Control steps of experience, all legs together, instead of the recipe's."""
    threads: int = 1
    """Threads of the networks and the physics."""
    ray: str | None = None
    """Address of a Ray cluster that collects the rollouts of all workers but the first, see
    `--set workers=4`, and tries the legs of `universal`; `local` starts one here."""
    json: JsonFile = None


def run(args: Options) -> None:
    """Train a controller."""
    from hopping_leg.rl.recipes import change, get_recipe, randomise
    from hopping_leg.rl.run_folder import read_result
    from hopping_leg.rl.train import train

    recipe = get_recipe(args.recipe)
    at_least(0, seed=args.seed)
    at_least(1, threads=args.threads, steps=args.steps)
    if args.steps is not None:
        recipe = recipe.replace(steps=args.steps)
    recipe = change(recipe, args.set)
    if args.randomise is not None:
        recipe = randomise(recipe, args.randomise)
    if args.observation is not None:
        recipe = recipe.replace({"task.observation": args.observation})
    recipe = recipe.replace(heights=args.heights)
    out = args.out or Path("runs") / f"{recipe.name}-seed{args.seed}"
    try:
        policy = train(
            recipe, load_robot(args.robot or recipe.robot), args.seed, out,
            resume=args.resume, minutes=args.minutes, threads=args.threads, ray=args.ray,
            command=COMMAND.get(),
        )  # fmt: skip
    except (KeyboardInterrupt, OSError, TraceError):
        print(f"Stopped; the same command with --resume goes on in {out}.", file=sys.stderr)
        raise
    say(policy.with_name("model_card.md").read_text(encoding="utf-8"))
    say(f"Policy: {policy}")
    save_json(args.json, read_result(policy.parent))
