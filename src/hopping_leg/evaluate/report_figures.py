"""All figures that a set of runs allows, for the report and for `hop report`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.evaluate.figures.results import draw_distributions, draw_ladder
from hopping_leg.evaluate.figures.runs import draw_estimate, draw_heights, draw_phase_space
from hopping_leg.evaluate.metrics import has_estimate, stretches
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.trials import Run, Trial
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class Picture:
    """One figure.

    Attributes:
        name: Short and unique, fit for a file name.
        title: Heading.
        caption: What is to be seen.
        figure: The figure.
        files: Names of the traces it is drawn from.
    """

    name: str
    title: str
    caption: str
    figure: Figure
    files: tuple[str, ...]


_HEIGHTS = {
    "sequence": (
        "All commands in turn",
        "Base height in the trial that commands each height for 5 s, as in the paper's Fig. 8."
        " Dots: apexes with the foot off the ground; thick lines: their median where they count.",
    ),
    "staircase": (
        "Staircase",
        "Base height while the command rises by 0.02 m (for this leg's size) every 5 s, as in the"
        " paper's Fig. 5.",
    ),
    "heights": (
        "Heights over time",
        "Base height over time. Dots: apexes with the foot off the ground.",
    ),
}


def draw_report_figures(evaluation: Evaluation, runs: Sequence[Run]) -> list[Picture]:
    """Draw every figure that the runs allow."""
    examples = _examples(runs)
    shown = {
        kind: _first_of_each(run for run in runs if run.trial.kind == kind)
        for kind in ("sequence", "staircase")
    }
    if not any(shown.values()):
        shown = {"heights": examples}
    pictures = [
        Picture(
            kind,
            *_HEIGHTS[kind],
            draw_heights({run.controller: run.trace for run in found}),
            tuple(run.file_name for run in found),
        )
        for kind, found in shown.items()
        if found
    ]
    if any(row.hops for row in evaluation.summary):
        caption = (
            "Every hop of the fixed trials and the sequence, pooled as in the paper's Fig. 9."
            " Coloured lines: medians; grey lines: commands."
        )
        figure, files = draw_distributions(evaluation), _files(runs, "fixed", "sequence")
        pictures.append(
            Picture("distributions", "Distributions of the apex", caption, figure, files)
        )
    if evaluation.ladder:
        caption = "Commands between and beyond the trained ones, 15 s each."
        figure, files = draw_ladder(evaluation), _files(runs, "ladder")
        pictures.append(Picture("ladder", "Ladder of commands", caption, figure, files))
    return pictures + [picture for run in examples for picture in _per_controller(run)]


def _files(runs: Sequence[Run], *kinds: str) -> tuple[str, ...]:
    return tuple(run.file_name for run in runs if run.trial.kind in kinds)


def _per_controller(run: Run) -> Iterator[Picture]:
    about = f"{run.controller}, command {run.trial.steps[0][0]:.2f} m"
    safe = run.file_name.removesuffix(".parquet")
    yield Picture(
        f"phase-space-{safe}",
        f"Knee torque in phase space: {run.controller}",
        "Torque asked of the knee at every configuration met in 10 s, as in the paper's Fig. 6."
        " Line: one phase from its start (circle) to its end (diamond).",
        draw_phase_space(run.trace, about),
        (run.file_name,),
    )
    if has_estimate(run.trace):
        yield Picture(
            f"estimate-{safe}",
            f"Estimated height: {run.controller}",
            "Height as the controller estimates it from its joints, beside the true height.",
            draw_estimate(run.trace, about),
            (run.file_name,),
        )


def _examples(runs: Sequence[Run]) -> list[Run]:
    """Return one fixed run per controller: the middle command, the first repeat."""
    fixed = [run for run in runs if len(run.trial.steps) == 1]
    examples = []
    for name in dict.fromkeys(run.controller for run in fixed):
        own = [run for run in fixed if run.controller == name]
        preferred = [run for run in own if run.trial.kind == "fixed"] or own
        commands = sorted({run.trial.steps[0][0] for run in preferred})
        middle = commands[len(commands) // 2]
        examples += _first_of_each(r for r in preferred if r.trial.steps[0][0] == middle)
    return examples


def _first_of_each(runs: Iterable[Run]) -> list[Run]:
    first: dict[str, Run] = {}
    for run in runs:
        known = first.get(run.controller)
        if known is None or run.repeat < known.repeat:
            first[run.controller] = run
    return list(first.values())


def run_of(path: Path) -> Run:
    """Load a trace as a run; traces from elsewhere count as fixed trials of their own."""
    trace = Trace.load(path)
    command, time = trace.column("command_m"), trace.column("time_s")
    period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    steps = tuple((float(command[a]), (b - a) * period) for a, b in stretches(command))
    header = trace.header
    default = "fixed" if len(steps) == 1 else "sequence"
    return Run(
        controller=str(header.get("controller", path.stem)),
        trial=Trial(steps, str(header.get("kind", default))),
        repeat=int(header.get("repeat", 0)),
        trace=trace,
    )
