"""The page of runs beside each other: it holds everything and needs nothing."""

from collections.abc import Callable
from typing import Any

from markupsafe import Markup

from hopping_leg.evaluate import html_tables
from hopping_leg.evaluate.compare import Compared, command_of, traces_of, training_row
from hopping_leg.evaluate.figures import draw_learning, to_svg
from hopping_leg.evaluate.gallery import Picture, draw_gallery
from hopping_leg.evaluate.html_tables import Column, millimetres, table
from hopping_leg.evaluate.report import data_uri, page_template
from hopping_leg.evaluate.result import Evaluation, Staircase, Summary


def write_comparison(compared: Compared, command: str = "") -> bytes:
    """Return the comparison as HTML.

    Args:
        compared: Runs beside each other.
        command: That makes the page again.
    """
    evaluation = compared.evaluation
    pictures = draw_gallery(evaluation, traces_of(compared)) if evaluation.summary else []
    page = page_template("compare.html.j2").render(
        title=f"Compared: {', '.join(run.label for run in compared.runs)}",
        command=command,
        compared=compared,
        beside=beside_table(evaluation),
        summary=html_tables.summary_table(evaluation.summary),
        pictures=[_picture(picture, evaluation) for picture in pictures],
        learning=_source(_learning(compared)) if compared.trainings else "",
        trainings=training_table(compared),
        differences=difference_table(compared),
        commands={run.label: command_of(run) for run in compared.runs},
    )
    return page.encode()


def beside_table(evaluation: Evaluation) -> Markup:
    """Return median error and spread, one line per command and one column per controller."""
    cells = {(row.command_m, row.controller): row for row in evaluation.summary}
    columns = [Column("command / m", lambda command: f"{command:.2f}")]
    columns += [Column(name, _cell(cells, name)) for name in evaluation.controllers]
    caption = "median of apex minus command, +- standard deviation of the hops, mm"
    return table(columns, sorted({command for command, _ in cells}), caption)


def training_table(compared: Compared) -> Markup:
    """Return one line per training."""
    rows = [training_row(label, result) for label, result in compared.trainings.items()]
    return table(
        [
            Column("training", lambda r: r["label"]),
            Column("recipe", lambda r: r["recipe"]),
            Column("robot", lambda r: r["robot"]),
            Column("seed", lambda r: f"{r['seed']}"),
            Column("steps", lambda r: f"{r['steps']}"),
            Column("minutes", lambda r: f"{r['minutes']:.1f}"),
            Column("selected at step", lambda r: f"{r['selected_steps']}"),
            Column("its score / mm", lambda r: millimetres(r["selected_score_m"])),
        ],
        rows,
    )


def difference_table(compared: Compared) -> Markup:
    """Return the conditions that are not the same in all evaluations."""
    rows = compared.differences
    labels = [key for key in rows[0] if key != "name"] if rows else []
    columns = [Column("condition", lambda r: r["name"])]
    columns += [Column(label.removeprefix("in "), _entry(label)) for label in labels]
    return table(columns, rows)


def _learning(compared: Compared) -> Any:  # noqa: ANN401
    return draw_learning({label: t["history"] for label, t in compared.trainings.items()})


def _picture(picture: Picture, evaluation: Evaluation) -> dict[str, Any]:
    beside = {
        "staircase": lambda: _staircases(evaluation),
        "ladder": lambda: html_tables.ladder_table(evaluation.ladder),
    }
    return {
        "title": picture.title,
        "caption": picture.caption,
        "source": _source(picture.figure),
        "table": beside.get(picture.name, lambda: Markup(""))(),
    }


def _staircases(evaluation: Evaluation) -> Markup:
    """Return one table per set of steps, as runs of different legs have different ones."""
    sets: dict[tuple[float, ...], list[Staircase]] = {}
    for stairs in evaluation.staircase:
        sets.setdefault(tuple(stairs.commands_m), []).append(stairs)
    return Markup("").join(map(html_tables.staircase_table, sets.values()))


def _source(figure: Any) -> str:  # noqa: ANN401
    return data_uri(to_svg(figure), "image/svg+xml")


def _cell(cells: dict[tuple[float, str], Summary], name: str) -> Callable[[Any], str]:
    def text(command: float) -> str:
        row = cells.get((command, name))
        if row is None:
            return ""
        return f"{millimetres(row.median_error_m, sign=True)} +- {millimetres(row.std_m)}"

    return text


def _entry(label: str) -> Callable[[Any], str]:
    return lambda row: str(row[label])
