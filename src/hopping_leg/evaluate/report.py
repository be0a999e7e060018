"""The report: figures of an evaluation, and one HTML page that holds all and needs nothing."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median_high
from typing import Any

from matplotlib.figure import Figure

from hopping_leg.evaluate import figures, runner, tables
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.trials import KINDS, Run
from hopping_leg.evaluate.video import Video
from hopping_leg.figures import controller_colours
from hopping_leg.html_page import data_uri, page_template, svg_uri
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class Picture:
    """One figure of a report."""

    name: str
    """Short and unique, fit for a file name."""
    title: str
    caption: str
    figure: Figure
    runs: Sequence[Run]
    """Drawn."""

    @property
    def command(self) -> str:
        """What draws it again from stored traces."""
        files = [f"TRACES/{run.file_name}" for run in self.runs]
        return f"hop report {' '.join(files if len(files) <= 3 else [*files[:2], '...'])}"


_OVER_TIME = {
    "staircase": ("Staircase", "while the command rises every 5 s, as in the paper's Fig. 5"),
    "sequence": ("All commands in turn", "while the command changes, as in the paper's Fig. 8"),
    "heights": ("Heights over time", "over time"),
}


def draw_report_figures(evaluation: Evaluation, runs: Sequence[Run]) -> list[Picture]:
    """Draw every figure that the runs allow; the first says most."""
    order = {name: place for place, name in enumerate(evaluation.controllers)}
    runs = sorted(runs, key=lambda run: (order.get(run.controller, 0), run.repeat))
    kinds = {kind: [run for run in runs if run.trial.kind == kind] for kind in KINDS}
    examples = _examples(runs)
    shown = {kind: _first(kinds[kind]) for kind in ("staircase", "sequence") if kinds[kind]}
    pictures = []
    for kind, found in (shown or {"heights": examples}).items():
        if found:
            title, when = _OVER_TIME[kind]
            caption = f"Base height {when}. Dots: apexes in flight; black: their median."
            figure = figures.draw_heights(_traces(found))
            pictures.append(Picture(kind, title, caption, figure, found))
    if any(row.hops for row in evaluation.summary):
        caption = (
            "Every hop of the fixed trials and the sequence, pooled as in the paper's Fig. 9."
            " Coloured lines: medians; grey lines: commands."
        )
        figure, drawn = figures.draw_distributions(evaluation), kinds["fixed"] + kinds["sequence"]
        title = "Distributions of the apex"
        pictures.append(Picture("distributions", title, caption, figure, drawn))
    if evaluation.ladder:
        caption = "Commands between and beyond the trained ones, 15 s each."
        figure, title = figures.draw_ladder(evaluation), "Ladder of commands"
        pictures.append(Picture("ladder", title, caption, figure, kinds["ladder"]))
    if examples:
        caption = (
            "Torque asked of the knee at every configuration met in 10 s of"
            f" {examples[0].trial.name}, as in the paper's Fig. 6. Line: one phase from its start"
            " (circle) to its end (diamond)."
        )
        figure, title = figures.draw_phase_space(_traces(examples)), "Knee torque in phase space"
        pictures.append(Picture("phase-space", title, caption, figure, examples))
    return pictures


def _first(runs: Iterable[Run]) -> list[Run]:
    """Return the first run of every controller."""
    found: dict[str, Run] = {}
    for run in runs:
        found.setdefault(run.controller, run)
    return list(found.values())


def _traces(runs: Sequence[Run]) -> dict[str, Trace]:
    return {run.controller: run.trace for run in runs}


def _examples(runs: Sequence[Run]) -> list[Run]:
    """Return a run of every controller at one command, the middle one or the next to it."""
    single = [run for run in runs if len(run.trial.steps) == 1]
    single = [run for run in single if run.trial.kind == "fixed"] or single
    if not single:
        return []
    middle = median_high(sorted({run.trial.steps[0][0] for run in single}))
    near = sorted(single, key=lambda run: abs(run.trial.steps[0][0] - middle))
    return sorted(_first(near), key=single.index)


def write_report(judged: runner.EvaluationRun, videos: Mapping[str, Video] | None = None) -> bytes:
    """Return the report as HTML, with the video of each controller if there are some."""
    evaluation = judged.evaluation
    page = page_template("hopping_leg.evaluate", "report.html.j2").render(
        title=f"Hopping leg: {', '.join(evaluation.controllers)}",
        evaluation=evaluation,
        colours=controller_colours(evaluation.controllers),
        verdict=tables.verdict,
        tables=tables.evaluation_tables(evaluation.to_json()),
        pictures=draw_report_figures(evaluation, judged.runs),
        videos=videos or {},
        data_uri=data_uri,
        svg_uri=svg_uri,
        conditions=flat_conditions({**evaluation.conditions, **evaluation.versions}),
    )
    return page.encode()


def flat_conditions(entries: dict[str, Any]) -> dict[str, str]:
    """Return conditions as texts, those of an inner table with its name before theirs."""
    found: dict[str, str] = {}
    for name, value in entries.items():
        inner = value if isinstance(value, dict) else {"": value}
        for key, entry in inner.items():
            text = f"{entry:g}" if isinstance(entry, float) else str(entry)
            found[f"{name} {key}".strip().replace("_", " ")] = text
    return found
