"""Ask how far the world may differ from what controllers believe before they fail.

Every axis (payload, friction, delay, noise, pushes, ...) is changed alone in rising levels, then
all at once; and the world changes in the middle of a run. A run that was killed goes on where it
was.

Examples:
  hop robustness mine=runs/mine/policy.onnx energy-shaping --out runs/robustness
  hop robustness fast --axes payload delay --seeds 3 --json payload.json
"""

from dataclasses import dataclass
from pathlib import Path

from hopping_leg import figure_style, io, progress
from hopping_leg.cli import evaluate, options
from hopping_leg.evaluate import figures, result_files, tables
from hopping_leg.evaluate.robustness.suite import make_suite, run_suite
from hopping_leg.terminal import plain_console


@dataclass(frozen=True)
class Robustness(evaluate.Conditions):
    """Which controllers meet which axes."""

    axes: tuple[str, ...] = ()
    """Axes by name; default: all, and changes in the middle of a run."""
    out: Path = Path("runs/robustness")
    """Folder for robustness.json, robustness.svg and all that a killed run goes on from."""


def run(args: Robustness) -> None:
    """Run the benchmark, print the scores, write everything."""
    entries, setup = args.load()
    heights, seeds = args.commands, args.seeds
    suite = make_suite(setup, axes=args.axes, commands=heights, repeats=seeds, seed=args.seed)
    with progress.ShareProgress(parts=len(entries)) as bar:
        found = run_suite(entries, suite, result_files.ResultCache(args.out), bar.show)
    result = {"command": options.command_line("hop robustness", args), **found}
    file, figure = args.json or args.out / "robustness.json", args.out / "robustness.svg"
    tables.print_robustness(plain_console(), result)
    options.save_json(file, result)
    io.write_atomically(figure, figure_style.to_svg(figures.draw_robustness(result)))
    options.say_written(file, figure)
