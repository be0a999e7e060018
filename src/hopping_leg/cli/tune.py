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
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.controllers.energy_shaping.tuning import Search, Tuned, tune
from hopping_leg.io import write_atomically, write_json
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class EnergyShaping:
    """Search the gains of energy shaping with CMA-ES."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    start: str = "by-hand"
    """Gains to begin from: by-hand, energy-shaping (the shipped result) or a gain file's path."""
    search: Annotated[Search, tyro.conf.arg(name="")] = field(default_factory=Search)
    seed: int = 0
    """Seed of the search; noise and delay take seeds 0 to 9."""
    out: Path = Path("runs/tune")
    """Folder for the log and the gains."""
    json: Path | None = None
    """Write every number to this file."""

    def search_all(self) -> None:
        """Search, print what came out, write the gains."""
        robot = load_robot(self.robot)
        with Progress() as progress:
            task = progress.add_task("searching", total=self.search.generations)

            def report(done: int, lowest: float) -> None:
                progress.update(task, completed=done, description=f"lowest cost {lowest:.2f} mm")

            tuned = tune(robot, self.robot, self.start, self.search, self.seed, self.out, report)
        Console().print(_table(tuned))
        Console().print(
            f"Gains: {self.out / 'gains.toml'}; use: hop evaluate {self.out / 'gains.toml'}"
        )
        if self.json is not None:
            write_json(self.json, tuned.record())


@dataclass(frozen=True)
class _Recipe:
    recipe: ClassVar[str]

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    trials: int = 50
    """Trials in the study when it is over, of all processes together."""
    steps: int = 1_000_000
    """Control steps of each training, all legs together."""
    study: str | None = None
    """SQLite file, or URL of another database, e.g. postgresql://...; default:
    runs/tune/RECIPE.db."""
    workers: int | None = None
    """Processes on this machine, one by default; more machines: the same command with the same
    --study, or --ray, where it counts the cluster's workers, by default one per CPU."""
    ray: str | None = None
    """Let the Ray cluster at this address work, each worker on one CPU; `local` starts one on this
    machine, `auto` finds the one that it belongs to."""
    snapshots: int = 5
    """Times that a training is tried before it ends, and may be given up."""
    startup: int = 10
    """Finished trials before any is given up, and before the search learns from them."""
    seed: int = 0
    """Seed of the trainings, and of the search."""
    set: tuple[str, ...] = ()
    """Numbers of the recipe that every trial takes, e.g. `--set num_envs=256`."""
    out: Path | None = None
    """Folder of the trainings, trials.json and the figures; default: runs/tune/RECIPE."""
    json: Path | None = None
    """Write all trials to this file, too."""

    def search_all(self) -> None:
        """Search, print the best, write all trials and the figures."""
        from hopping_leg.evaluate.figures.tuning import FIGURES
        from hopping_leg.figure_style import to_svg
        from hopping_leg.rl.tuning import Tuning
        from hopping_leg.rl.tuning import tune as tune_recipe

        at_least(1, workers=1 if self.workers is None else self.workers)
        out = self.out or Path("runs/tune") / self.recipe
        tuning = Tuning(
            self.recipe,
            _storage(self.study or f"runs/tune/{self.recipe}.db"),
            out,
            self.robot,
            self.trials,
            self.steps,
            self.snapshots,
            self.startup,
            self.seed,
            self.set,
        )
        result = tune_recipe(tuning, self.workers, self.ray)
        for file in filter(None, (out / "trials.json", self.json)):
            write_json(file, result)
        for name, draw in FIGURES.items():
            write_atomically(out / f"{name}.svg", to_svg(draw(result)))
        _print(result, out)


@dataclass(frozen=True)
class Fast(_Recipe):
    """Search the numbers of recipe fast with Optuna."""

    recipe: ClassVar[str] = "fast"


@dataclass(frozen=True)
class Paper(_Recipe):
    """Search the numbers of recipe paper with Optuna."""

    recipe: ClassVar[str] = "paper"


@dataclass(frozen=True)
class Precise(_Recipe):
    """Search the numbers of recipe precise with Optuna."""

    recipe: ClassVar[str] = "precise"


def run(args: EnergyShaping | Fast | Paper | Precise) -> None:
    """Search."""
    args.search_all()


def _storage(study: str) -> str:
    """Return the URL of a study's database; the folder of a file is made."""
    if "://" in study:
        return study
    file = Path(study).resolve()
    file.parent.mkdir(parents=True, exist_ok=True)
    return f"sqlite:///{file}"


def _print(result: dict[str, Any], out: Path) -> None:
    best, trials = result["best"], result["trials"]
    states = [trial["state"] for trial in trials]
    counts = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    Console().print(f"{len(trials)} trials: {counts}.")
    if best is not None:
        table = Table(
            "number", "best", title=f"trial {best['number']}: {1e3 * best['score_m']:.1f} mm"
        )
        for name, value in best["params"].items():
            table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
        Console().print(table)
    Console().print(
        f"Wrote {out}/trials.json and the figures beside it.", highlight=False, soft_wrap=True
    )


def _table(tuned: Tuned) -> Table:
    table = Table("command, m", "median before", "after", "std before, mm", "after")
    for before, after in zip(tuned.before, tuned.after, strict=True):
        numbers: list[Any] = [
            f"{before.command:.2f}",
            f"{before.median:.4f}",
            f"{after.median:.4f}",
        ]
        numbers += [f"{1e3 * before.std:.1f}", f"{1e3 * after.std:.1f}"]
        table.add_row(*numbers)
    return table
