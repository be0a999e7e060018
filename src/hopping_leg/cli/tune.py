"""Search the gains of energy shaping, or the numbers and networks of a training recipe.

energy-shaping: CMA-ES over the gains, written as a gain file. All candidates hop at once, each at
five heights and from three first gains, with the paper's noise and delay. An interrupted search
goes on where it was: call it again with the same options.

fast, paper, precise: Optuna over the recipe's numbers (extra `tune`). Each trial is a training; its
score is that by which `hop train` selects. Trainings that lag behind are given up. The study is a
database: call it again, here or elsewhere, and it goes on; call it in several places at once, and
they share the work, or let a Ray cluster do so.

Examples:
  hop tune energy-shaping
  hop tune energy-shaping --robot my_leg.toml --out runs/my_leg
  hop tune energy-shaping --flight 0.5     # in the air for half of the time, at every height
  hop tune fast --trials 60 --steps 1000000 --workers 2
  hop tune paper --study postgresql://host/tuning --trials 100
  hop tune paper --study postgresql://host/tuning --trials 100 --ray auto
"""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from hopping_leg.cli.options import (
    JsonFile,
    RobotFile,
    at_least,
    save_json,
    say,
    say_next,
    show_table,
)
from hopping_leg.controllers.energy_shaping.tuning import Search, tune
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.locks import hold_folder
from hopping_leg.progress import LiveProgress, said_if_slow
from hopping_leg.rl.search_space import Tuning
from hopping_leg.robot import DEFAULT_ROBOT, load_robot


@dataclass(frozen=True)
class GainSearch:
    """Search the gains of energy shaping with CMA-ES."""

    robot: RobotFile = DEFAULT_ROBOT
    start: str = "by-hand"
    """Gains to begin from: by-hand, energy-shaping (the shipped result) or a gain file's path."""
    search: Annotated[Search, tyro.conf.arg(name="")] = field(default_factory=Search)
    seed: int = 0
    """Seed of the search; noise and delay take seeds 0 to 9."""
    out: Path = Path("runs/tune")
    """Folder for the log and the gains."""
    json: JsonFile = None


@dataclass(frozen=True)
class RecipeSearch:
    """Search the numbers of a recipe with Optuna."""

    tuning: Annotated[Tuning, tyro.conf.arg(name="")]
    workers: int | None = None
    """Processes on this machine, one by default; more machines: the same command with the same
    --study, or --ray, where it counts the cluster's workers, by default one per CPU."""
    ray: str | None = None
    """Let the Ray cluster at this address work, each worker on one CPU; `local` starts one on this
    machine, `auto` finds the one that it belongs to."""
    json: JsonFile = None


FAST, PAPER, PRECISE = (RecipeSearch(Tuning(name)) for name in ("fast", "paper", "precise"))


def run(
    args: Annotated[GainSearch, tyro.conf.subcommand(name="energy-shaping")]
    | Annotated[RecipeSearch, tyro.conf.subcommand(name="fast", default=FAST)]
    | Annotated[RecipeSearch, tyro.conf.subcommand(name="paper", default=PAPER)]
    | Annotated[RecipeSearch, tyro.conf.subcommand(name="precise", default=PRECISE)],
) -> None:
    """Search."""
    if isinstance(args, GainSearch):
        with hold_folder(args.out, UsageError):
            _tune_gains(args)
    else:
        _tune_recipe(args)


class SearchProgress(LiveProgress):
    """Generations done of a search for gains, and the lowest cost, as a context manager."""

    def update(self, generations: int, done: int, lowest: float) -> None:
        """Show how many of all generations are done, and the lowest cost, mm."""
        self._show("search", "searching", done / generations, f"lowest cost {lowest:.2f} mm")


def _tune_gains(args: GainSearch) -> None:
    """Search, print what came out, write the gains."""
    robot = load_robot(args.robot)
    with SearchProgress("searching") as progress:
        report = partial(progress.update, args.search.generations)
        tuned = tune(robot, args.robot, args.start, args.search, args.seed, args.out, report)
    show_table(
        ("command, m", "median before", "after", "std before, mm", "after"),
        [
            (
                f"{before['command']:.2f}",
                *(f"{score['median']:.4f}" for score in (before, after)),
                *(f"{1e3 * score['std']:.1f}" for score in (before, after)),
            )
            for before, after in zip(tuned["before"], tuned["after"], strict=True)
        ],
    )
    gains = args.out / "gains.toml"
    say(f"Gains: {gains}")
    say_next(["hop", "evaluate", gains, "--robot", args.robot])
    save_json(args.json, tuned)


def _tune_recipe(args: RecipeSearch) -> None:
    """Search, print the best, write all trials and the figures."""
    with said_if_slow("Loading torch and optuna."):
        from hopping_leg.figure_style import to_svg
        from hopping_leg.rl.tuning import tune as tune_recipe
        from hopping_leg.rl.tuning_figures import FIGURES

    at_least(1, workers=args.workers)
    out = args.tuning.folder
    with said_if_slow(f"Trainings go on in {out}/trial-*."):
        result = tune_recipe(args.tuning, args.workers, args.ray)
    _show(result)
    for file in (out / "trials.json", args.json):
        save_json(file, result)
    for name, draw in FIGURES.items():
        write_atomically(out / f"{name}.svg", to_svg(draw(result)))
    say(f"Wrote {out}/trials.json and the figures beside it.")


def _show(result: dict[str, Any]) -> None:
    best, states = result["best"], [trial["state"] for trial in result["trials"]]
    counts = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    say(f"{len(states)} trials: {counts}.")
    if best is not None:
        rows = [
            (name, f"{value:.4g}" if isinstance(value, float) else value)
            for name, value in best["params"].items()
        ]
        title = f"trial {best['number']}: {1e3 * best['score_m']:.1f} mm"
        show_table(("number", "best"), rows, title)
