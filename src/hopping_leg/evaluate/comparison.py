"""Several stored runs beside each other: one evaluation of all, where they differ, and its page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from markupsafe import Markup

from hopping_leg.errors import UsageError
from hopping_leg.evaluate import figures, report, result_files, trials
from hopping_leg.evaluate.result import Evaluation, flat_conditions
from hopping_leg.evaluate.tables import JOINTS, LOAD, SUMMARY, column, millimetres
from hopping_leg.html_page import Column, page_template, svg_uri, table

_OF_CONTROLLERS = ("summary", "sequence", "ladder", "staircase", "neighbours", "estimators")
"""Tables of an evaluation whose rows belong to a controller."""


@dataclass(frozen=True)
class Compared:
    """Runs beside each other."""

    runs: tuple[result_files.StoredRun, ...]
    evaluation: Evaluation
    """All evaluations as one; empty if there are trainings alone."""
    differences: list[dict[str, str]]
    """Conditions that are not the same in all evaluations: ``name`` and a text per run."""
    trainings: dict[str, dict[str, Any]]
    """Results of trainings by label."""
    notes: list[str]
    """What makes the comparison less than fair."""

    def to_json(self) -> dict[str, Any]:
        """Return plain values; numbers that do not exist are NaN."""
        return {
            "runs": [
                {"label": run.label, "path": str(run.path), "command": command_of(run)}
                for run in self.runs
            ],
            "notes": self.notes,
            "differences": self.differences,
            "evaluation": self.evaluation.to_json(),
            "trainings": [training_row(label, t) for label, t in self.trainings.items()],
        }


def set_beside(runs: Sequence[result_files.StoredRun]) -> Compared:
    """Compare two runs or more.

    Raises:
        UsageError: They are too few or have nothing in common.
    """
    if len(runs) < 2:
        raise UsageError("One run has nothing beside it; name two or more.")
    judged = [run for run in runs if run.evaluation is not None]
    trainings = {run.label: run.training for run in runs if run.training is not None}
    if len(judged) < 2 and len(trainings) < 2:
        raise UsageError(
            f"{runs[0].label} and {runs[1].label} have nothing in common: one is an evaluation, the"
            " other a training; judge the training's policy with `hop evaluate` first."
        )
    evaluations = {run.label: run.evaluation for run in judged if run.evaluation is not None}
    _check_commands(evaluations)
    differences = _differences({label: e.conditions for label, e in evaluations.items()})
    notes = _notes(runs, differences)
    return Compared(tuple(runs), _merge(evaluations), differences, trainings, notes)


def traces_of(compared: Compared) -> list[trials.Run]:
    """Load the first sequence and staircase of every controller, where traces were kept."""
    found = []
    others = {run.label: run.evaluation for run in compared.runs if run.evaluation}
    for stored in compared.runs:
        evaluation = stored.evaluation
        if evaluation is None or stored.traces is None:
            continue
        name = _name(others, stored.label)
        for kind in ("sequence", "staircase"):
            runs = [
                trials.load_run(path) for path in sorted(stored.traces.glob(f"*-{kind}-0.parquet"))
            ]
            known = [run for run in runs if run.controller in evaluation.controllers]
            found += [replace(r, controller=name(r.controller)) for r in known]
    return found


def command_of(run: result_files.StoredRun) -> str:
    """Return the commands that make a run again."""
    evaluated = run.evaluation.command if run.evaluation else ""
    trained = str((run.training or {}).get("command", ""))
    return "\n".join(filter(None, (trained, evaluated)))


def training_row(label: str, result: dict[str, Any]) -> dict[str, Any]:
    """Return the main numbers of a training and its learning curve."""
    selected = result["selected"]
    return {
        "label": label,
        **{name: result[name] for name in ("recipe", "robot", "seed", "minutes", "steps")},
        "selected_steps": selected["steps"],
        "selected_score_m": selected["score_m"],
        "curve": [
            {k: row[k] for k in ("steps", "minutes", "score_m")} for row in result["history"]
        ],
    }


def _check_commands(evaluations: dict[str, Evaluation]) -> None:
    commands = {
        label: {row.command_m for row in (*e.summary, *e.ladder)}
        for label, e in evaluations.items()
    }
    for label, own in commands.items():
        others = set().union(*(theirs for name, theirs in commands.items() if name != label))
        if len(commands) > 1 and not own & others:
            raise UsageError(
                f"{label} has no command in common with the others (it has {_heights(own)}, they"
                f" {_heights(others)}); evaluate it with the same --commands."
            )


def _heights(commands: set[float]) -> str:
    return ", ".join(f"{c:g}" for c in sorted(commands)) + " m" if commands else "none"


def _merge(evaluations: dict[str, Evaluation]) -> Evaluation:
    """Return all rows as one evaluation, controllers named apart."""
    fields: dict[str, Any] = {field: [] for field in (*_OF_CONTROLLERS, "distributions")}
    for label, evaluation in evaluations.items():
        name = _name(evaluations, label)
        for field in _OF_CONTROLLERS:
            fields[field] += [
                replace(row, controller=name(row.controller)) for row in getattr(evaluation, field)
            ]
        fields["distributions"] += [
            {**entry, "controller": name(entry["controller"])} for entry in evaluation.distributions
        ]
    notes = dict.fromkeys(note for e in evaluations.values() for note in e.notes)
    return Evaluation(**fields, notes=list(notes))


def _name(evaluations: dict[str, Evaluation], label: str) -> Callable[[str], str]:
    """Return how a run's controllers are called: with its label where another has the same."""
    others = {c for name, e in evaluations.items() if name != label for c in e.controllers}
    return lambda controller: f"{label}: {controller}" if controller in others else controller


def _differences(conditions: dict[str, dict[str, Any]]) -> list[dict[str, str]]:
    flat = {label: flat_conditions(entries) for label, entries in conditions.items()}
    names = dict.fromkeys(name for entries in flat.values() for name in entries)
    rows = []
    for name in names:
        texts = {label: entries.get(name, "-") for label, entries in flat.items()}
        if len(set(texts.values())) > 1:
            rows.append({"name": name, **{f"in {label}": text for label, text in texts.items()}})
    return rows


def _notes(runs: Sequence[result_files.StoredRun], differences: list[dict[str, str]]) -> list[str]:
    """Return what makes a comparison less than fair."""
    robots: dict[tuple[str, str], list[str]] = {}
    for run in runs:
        for source in (run.evaluation.conditions if run.evaluation else None, run.training):
            if source:
                key = (str(source.get("robot", "?")), str(source.get("robot_digest", "?")))
                robots.setdefault(key, []).append(run.label)
    notes = []
    if len(robots) > 1:
        named = "; ".join(
            f"{robot} ({digest}) in {', '.join(dict.fromkeys(labels))}"
            for (robot, digest), labels in robots.items()
        )
        notes.append(
            f"The robots differ: {named}. Numbers of different legs are not the same task."
        )
    names = [row["name"] for row in differences if not row["name"].startswith("robot")]
    if names:
        notes.append(f"The conditions differ: {', '.join(names)}; see the table.")
    for kind in ("evaluation", "training"):
        labels = [run.label for run in runs if getattr(run, kind) is not None]
        if len(labels) == 1:
            notes.append(
                f"{labels[0]} is the only {kind} here; nothing of its kind stands beside it."
            )
    return notes


def write_comparison(compared: Compared, command: str = "") -> bytes:
    """Return the comparison as HTML, with the command that makes the page again."""
    evaluation = compared.evaluation
    differing = next(iter(compared.differences), {})
    rows = [training_row(label, training) for label, training in compared.trainings.items()]
    histories = {label: training["history"] for label, training in compared.trainings.items()}
    pictures = report.pictures_of(evaluation, traces_of(compared)) if evaluation.summary else []
    for picture in pictures:
        picture["command"] = ""  # its traces lie in several folders
    page = page_template("hopping_leg.evaluate", "compare.html.j2").render(
        title=f"Compared: {', '.join(run.label for run in compared.runs)}",
        command=command,
        verdicts=report.verdicts(evaluation),
        notes=[*compared.notes, *evaluation.notes],
        beside=_beside_table(evaluation),
        summary=table(SUMMARY, evaluation.summary),
        load=table(LOAD, evaluation.summary),
        joints=table(JOINTS, evaluation.summary),
        lead=pictures[:1],
        pictures=pictures[1:],
        learning=svg_uri(figures.draw_learning(histories)) if histories else "",
        trainings=table(_TRAINING, rows),
        differences=table(
            [column(name.removeprefix("in "), name) for name in differing], compared.differences
        ),
        commands={run.label: command_of(run) for run in compared.runs},
    )
    return page.encode()


def _beside_table(evaluation: Evaluation) -> Markup:
    """Return median error and spread, one line per command and one column per controller."""
    cells = {
        (row.command_m, row.controller): (
            f"{millimetres(row.median_error_m, sign=True)} ± {millimetres(row.std_m)}"
        )
        for row in evaluation.summary
    }

    def of(controller: str) -> Column:
        return Column(controller, lambda command: cells.get((command, controller), ""))

    columns = [Column("command / m", lambda command: f"{command:.2f}")]
    columns += map(of, evaluation.controllers)
    caption = "median of apex minus command ± standard deviation of the hops, mm"
    return table(columns, sorted({command for command, _ in cells}), caption)


_TRAINING = (
    column("training", "label"),
    column("recipe", "recipe"),
    column("robot", "robot"),
    column("seed", "seed"),
    column("steps", "steps"),
    column("minutes", "minutes", ".1f"),
    column("selected at step", "selected_steps"),
    column("its score / mm", "selected_score_m", ".1f", 1e3),
)
