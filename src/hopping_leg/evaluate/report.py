"""The report: figures of an evaluation, and one HTML page that holds all and needs nothing."""

import json
from collections.abc import Iterable, Sequence
from statistics import median_high

from matplotlib.figure import Figure

from hopping_leg.evaluate import figures, runner, tables
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.trials import Run
from hopping_leg.figures import controller_colours
from hopping_leg.html_page import page_template, svg_uri
from hopping_leg.trace import Trace


def draw_report_figures(evaluation: Evaluation, runs: Sequence[Run]) -> dict[str, Figure]:
    """Draw every figure that the runs allow, by name; the first says most."""
    found: dict[str, Figure] = {}
    for kind in ("staircase", "sequence"):
        if shown := _first(run for run in runs if run.trial.kind == kind):
            found[kind] = figures.draw_heights(shown)
    # A run of every controller at one command, the middle one or near it.
    single = [run for run in runs if len(run.trial.steps) == 1]
    single = [run for run in single if run.trial.kind == "fixed"] or single
    middle = median_high(sorted({run.trial.steps[0][0] for run in single} or {0.0}))
    near = _first(sorted(single, key=lambda run: abs(run.trial.steps[0][0] - middle)))
    examples = {name: near[name] for name in _first(single)}
    if examples and not found:
        found["heights"] = figures.draw_heights(examples)
    if any(row.hops for row in evaluation.summary):
        found["distributions"] = figures.draw_distributions(evaluation)
    if evaluation.ladder:
        found["ladder"] = figures.draw_ladder(evaluation)
    if examples:
        found["phase-space"] = figures.draw_phase_space(examples)
    return found


def _first(runs: Iterable[Run]) -> dict[str, Trace]:
    """Return the trace of the first run of every controller."""
    found: dict[str, Trace] = {}
    for run in runs:
        found.setdefault(run.controller, run.trace)
    return found


def write_report(judged: runner.EvaluationRun) -> bytes:
    """Return the report as HTML."""
    evaluation = judged.evaluation
    values = evaluation.to_json()
    conditions = {**values["conditions"], "versions": values["versions"]}
    page = page_template("hopping_leg.evaluate", "report.html.j2").render(
        title=f"Hopping leg: {', '.join(evaluation.controllers)}",
        evaluation=evaluation,
        colours=controller_colours(evaluation.controllers),
        verdict=tables.verdict,
        tables=tables.evaluation_tables(values),
        figures=draw_report_figures(evaluation, judged.runs),
        svg_uri=svg_uri,
        conditions=json.dumps(conditions, indent=1, ensure_ascii=False),
    )
    return page.encode()
