"""Measure skills beyond the paper: so many hops and stop, stairs, soft landings.

Examples:
  hop skills fast energy-shaping --json skills.json
  hop skills fast --floor soft --commands 0.3
"""

from dataclasses import dataclass
from typing import Literal

from hopping_leg import progress
from hopping_leg.cli import evaluate, options
from hopping_leg.evaluate.skills.suite import run_skills
from hopping_leg.evaluate.tables import print_skills
from hopping_leg.terminal import plain_console


@dataclass(frozen=True)
class Skills(evaluate.Conditions):
    """Which controllers, and where they hop."""

    floor: Literal["soft", "stiff", "both"] = "both"
    """The robot's own contact (soft), the engine's default (stiff), or one after the other."""


def run(args: Skills) -> None:
    """Run all skills, print their tables, write what was asked for."""
    entries, setup = args.load()
    with progress.ShareProgress(parts=len(entries)) as bar:
        found = run_skills(
            entries,
            setup,
            floors=("soft", "stiff") if args.floor == "both" else (args.floor,),
            commands=args.commands,
            repeats=args.seeds,
            seed=args.seed,
            on_progress=bar.show,
        )
    result = {"command": options.command_line("hop skills", args), **found}
    print_skills(plain_console(), result)
    options.save_json(args.json, result)
    options.say_written(args.json)
