"""Run the paper's sim-to-real experiment on twins: record, identify, train, hop; or foretell.

A twin plays the real leg: it differs from the CAD in what a fit can find and in what no fit knows.
It is recorded, identified from the recordings alone, a policy is trained on what was identified,
and hops on the twin without tuning; beside it policies trained on the CAD's robot, on the paper's
Table I, and with domain randomisation. What trainings add, luck included, is left out by
`prediction`: there the simulations only foretell how high a shipped policy hops on the twins, so
that ways to identify can be compared by their fits alone. Every stage's results stay in the folder:
the same command goes on after an interruption, and further methods, twins or seeds add to what is
there.

Examples:
  hop experiment transfer --json transfer.json
  hop experiment prediction --json prediction.json
  hop experiment transfer --twins 10 --seeds 0 1 2 --jobs 8
  hop experiment transfer --twins my_twin.toml other_twin.toml --methods identified cad
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.command_line import KEPT, command_line
from hopping_leg.cli.options import Heights
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.transfer.methods import DEFAULT, FORETOLD, choose_methods
from hopping_leg.evaluate.transfer.study import Study, find_twins
from hopping_leg.io import write_json


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    experiment: tyro.conf.Positional[Literal["transfer", "prediction"]]
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


def run(args: Experiment) -> None:
    """Run the experiment, print the tables, write the JSON."""
    if args.jobs < 1:
        raise UsageError(f"--jobs is {args.jobs} but must be at least 1.")
    from hopping_leg.evaluate.transfer.run import predict, transfer

    foretell = args.experiment == "prediction"
    usual = FORETOLD if foretell else DEFAULT
    study = Study(
        args.folder,
        find_twins(args.twins, args.folder / "twins"),
        tuple(choose_methods(args.methods or usual)),
        seeds=args.seeds,
        recipe=args.recipe,
        changes=args.set,
        steps=args.steps,
        seconds=args.seconds,
        generations=args.generations,
        commands=args.commands,
        repeats=args.repeats,
        effects=args.effects,
        threads=args.threads,
    )
    result = predict(study, args.jobs) if foretell else transfer(study, args.jobs)
    if args.json is not None:
        command = command_line("hop experiment", args, KEPT | {"threads"})
        write_json(args.json, {"command": command, **result})
    (show_predictions if foretell else show)(result)


def show(result: dict[str, Any]) -> None:
    """Print a study's tables."""
    table = Table("trained on", "command, mm", "|error|, mm", "95 %", "error, mm", "skipped")
    for row in result["rows"]:
        low, high = (_mm(row[f"median_abs_error_{end}_m"]) for end in ("low", "high"))
        table.add_row(
            row["method"],
            _mm(row["command_m"]),
            _mm(row["median_abs_error_m"]),
            f"{low}-{high}",
            _mm(row["median_error_m"]),
            f"{row['skipped_hops']}/{row['hops'] + row['skipped_hops']}",
        )
    console = Console()
    console.print(table)
    _show_overall(console, result)
    if "best_in_own_simulation" in result:
        console.print("\nOf several trainings, those alone that hop best in their own simulation:")
        _show_overall(console, result["best_in_own_simulation"])


def _show_overall(console: Console, result: dict[str, Any]) -> None:
    for row in result["methods"]:
        console.print(
            f"{row['method']}: {_mm(row['median_abs_error_m'])} mm over all commands,"
            f" {row['ordered']} of {row['policies']} policies in order",
            highlight=False,
        )
    for row in result["comparison"]:
        console.print(
            f"{row['method']} errs {row['ratio']:.1f} times as much as {row['over']}"
            f" ({row['ratio_low']:.1f} to {row['ratio_high']:.1f})",
            highlight=False,
        )


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
