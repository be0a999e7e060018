"""The main job: train a controller from scratch, evaluate it beside the shipped ones, report.

Trains with the fast recipe, then runs the paper's trials for the new policy, the shipped policies
and energy shaping, and writes one report. Takes about ten minutes on two cores. A run that was
interrupted or killed goes on where it was when the same command is called again.

Examples:
  hop reproduce
  hop reproduce --quick --out runs/look
  hop reproduce --seed 1 --out runs/second
"""

import time
from dataclasses import dataclass
from pathlib import Path

from hopping_leg.cli import evaluate
from hopping_leg.control.library import ENERGY_SHAPING, shipped_policies
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class Reproduce:
    """What to reproduce and where to keep it."""

    out: Path = Path("runs/reproduce")
    """Folder for the training, evaluation.json, report.html and traces/."""
    seed: int = 0
    """Of the training; the evaluation's seeds follow from another number."""
    minutes: float = 5.0
    """Wall-clock time of the training."""
    threads: int = 2
    """Threads of the training."""
    robot: str = "legv2-paper"
    """A shipped robot or a .toml file."""
    quick: bool = False
    """A look at the whole chain in a minute or two: short training, which will not hop well, and
    one evaluation seed."""
    json: Path | None = None
    """File for every number, besides evaluation.json."""


def run(args: Reproduce) -> None:
    """Train, evaluate, compare, report."""
    start = time.monotonic()
    _check(args)
    policy = _train(args)
    if args.robot == Reproduce.robot:
        others = (*shipped_policies(), ENERGY_SHAPING)
    else:
        others = (ENERGY_SHAPING,)
    evaluate.run(
        evaluate.Evaluate(
            controllers=(str(policy), *others),
            robot=args.robot,
            seeds=1 if args.quick else 5,
            out=args.out,
            json=args.json,
            floor="soft" if args.quick else "both",
            video=not args.quick,
        )
    )
    print(
        f"Done in {(time.monotonic() - start) / 60:.1f} minutes.\n"
        f"Report: {(args.out / 'report.html').resolve()}\n"
        f"Policy: {policy} (its model card lies beside it)"
    )


def _check(args: Reproduce) -> None:
    if args.seed < 0 or args.threads < 1 or not 0 < args.minutes < float("inf"):
        raise UsageError(
            "--seed must not be negative, --threads must be at least 1, --minutes above 0."
        )


def _train(args: Reproduce) -> Path:
    """Return the trained policy, trained now unless an earlier call has finished it."""
    from hopping_leg.learn.recipes import get_recipe
    from hopping_leg.learn.run_folder import RunFolder
    from hopping_leg.learn.train import train

    recipe, robot = get_recipe("fast"), load_robot(args.robot)
    minutes = min(args.minutes, 0.5) if args.quick else args.minutes
    folder = RunFolder(args.out / "training", recipe, robot, args.seed, minutes)
    if folder.policy.exists():
        folder.check_same()
        print(f"{folder.policy} was trained by an earlier call; delete {folder.path} to repeat it.")
        return folder.policy
    trained = train(
        recipe, robot, args.seed, folder.path, resume=True, minutes=minutes, threads=args.threads
    )
    return trained.policy
