"""Options of the sim-to-real study, and its tables."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.console import Console

from hopping_leg.cli.options import Heights, at_least
from hopping_leg.cli.reproduce import show_transfer
from hopping_leg.sim_to_real.methods import DEFAULT, FORETOLD, choose_methods
from hopping_leg.sim_to_real.study import Study, find_twins


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    experiment: tyro.conf.Positional[Literal["transfer", "prediction"]] = "transfer"
    """Train and hop on the twins, or foretell hops."""
    twins: tuple[str, ...] = ("5",)
    """How many twins to draw, or robot files that extend what is believed of them."""
    methods: tuple[str, ...] | None = None
    """What policies are trained on, the others being compared with the first; or what foretells.
    Valid: identified, cad, table-1, randomised, identified-surprises, cad-surprises (these three
    not to foretell), rail-only, fixed-base-only, two-pass, one-pass, truth. Default: the first
    four; or all that can foretell."""
    seeds: tuple[int, ...] = (0,)
    """Of the trainings, one of each method and twin each."""
    recipe: str = "adaptive"
    """By which policies are trained, as in `hop train`; `fast` is the quicker one, but
    corrects nothing of what no fit can find."""
    set: tuple[str, ...] = ()
    """Numbers of the recipe to change, as in `hop train`; not its steps."""
    steps: int = Study.steps
    """Control steps of experience of a training."""
    seconds: float = 60.0
    """Of each recording; the paper's are 240 s."""
    generations: int = 100
    """Of CMA-ES in each pass, for the methods two-pass and one-pass."""
    commands: Heights = Study.commands
    """Apex heights at which the twins are tried, m."""
    repeats: int = 3
    """Runs of 15 s at each command."""
    effects: bool = False
    """Let the first method's policies also meet the twins with one effect less at a time: what each
    effect costs."""
    jobs: int = 1
    """Recordings, fits, trainings or trials at the same time, each in its own process."""
    threads: int = 1
    """Of each job."""
    folder: Path = Path("runs/transfer")
    """For recordings, robots, trainings and trials; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run the experiment, print the tables, return every number."""
        at_least(1, jobs=self.jobs)
        from studies.sim_to_real.run import predict, transfer_and_effects

        foretell = self.experiment == "prediction"
        usual = FORETOLD if foretell else DEFAULT
        study = Study(
            self.folder,
            find_twins(self.twins, self.folder / "twins"),
            tuple(choose_methods(self.methods or usual)),
            seeds=self.seeds,
            recipe=self.recipe,
            changes=self.set,
            steps=self.steps,
            seconds=self.seconds,
            generations=self.generations,
            commands=self.commands,
            repeats=self.repeats,
            effects=self.effects,
            threads=self.threads,
        )
        result = predict(study, self.jobs) if foretell else transfer_and_effects(study, self.jobs)
        (show_predictions if foretell else show_transfer)(result)
        return result


def show_predictions(result: dict[str, Any]) -> None:
    """Print how far off each method's predictions are."""
    console = Console()
    for row in result["methods"]:
        console.print(
            f"{row['method']} foretells apexes to {_mm(row['median_abs_error_m'])} mm"
            f" ({_mm(row['median_abs_error_low_m'])} to {_mm(row['median_abs_error_high_m'])})",
            highlight=False,
        )


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.0f}"
