"""Numbers and tables from the studies' results, each with the command that makes it.

A result is named ``STUDY/FILE``, e.g. ``speed/env.json``.
"""

import dataclasses
import importlib
import json
from dataclasses import astuple
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from studies.evaluation.accuracy import LEAST_FLIGHT, LOWER, accuracies

from hopping_leg import figure_style
from hopping_leg.cli.demo import BEST
from hopping_leg.controllers.registry import ENERGY_SHAPING, MPC_TRUE_STATE

STUDIES = Path(__file__).parent.parent / "studies"


@dataclasses.dataclass(frozen=True)
class Column:
    """A column ``"key"``, ``"key=title"`` or ``"key*factor=title"`` of a table.

    A key that a row does not have is a dotted path in it.
    """

    key: str
    title: str
    factor: float | None

    @staticmethod
    def parse(text: str) -> "Column":
        """Read a column's text."""
        left, _, title = text.partition("=")
        key, _, factor = left.partition("*")
        return Column(key, title or key, float(factor) if factor else None)

    def cell(self, row: dict[str, Any]) -> str:
        """Return this column of a row as text."""
        found = row[self.key] if self.key in row else pick(row, self.key)
        return number(scaled(found, self.factor))


def scaled(value: Any, factor: float | None) -> Any:  # noqa: ANN401
    """Return a number, or each of a list, times a factor."""
    if factor is None or value is None:
        return value
    return [scaled(entry, factor) for entry in value] if isinstance(value, list) else value * factor


def number(value: Any) -> str:  # noqa: ANN401
    """Return a value as a reader wants it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    if isinstance(value, list):
        return ", ".join(number(entry) for entry in value)
    return str(value)


def read(file: str) -> Any:  # noqa: ANN401
    """Return the content of a result."""
    study, name = file.split("/")
    return json.loads((STUDIES / study / "results" / name).read_text(encoding="utf-8"))


def pick(tree: Any, path: str) -> Any:  # noqa: ANN401
    """Return the entry at a dotted path; numbers index lists, an empty path is the whole."""
    for key in filter(None, path.split(".")):
        tree = tree[int(key)] if isinstance(tree, list) else tree[key]
    return tree


def safety_case() -> str:
    """Return the table of the safety case, from the fault campaign's families and results."""
    file = "fault_campaign/fault_campaign.json"
    campaign = read(file) if stored(file) else {"rows": []}
    lines = ["| fault | noticed by | then | within, ms | trials | unsafe | at most, 95 % |"]
    lines.append("|---|---|---|---|---|---|---|")
    for row in importlib.import_module("studies.fault_campaign.safety_case").rows(campaign):
        most = "–" if row["upper_bound"] is None else f"{100 * row['upper_bound']:.2g} %"
        within = number(scaled(row["within_s"], 1e3))
        names = "fault", "noticed_by", "follows"
        cells = (*(row[name] for name in names), within, row["trials"], row["unsafe"], most)
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def not_certified() -> str:
    """Return where the list of what the safety case does not show stands."""
    return tables("fault_campaign")


def value(file: str, path: str, factor: float | None = None, digits: int | None = None) -> str:
    """Return one number of a result, times a factor, with so many digits after the point."""
    found = scaled(pick(read(file), path), factor)
    return number(found) if digits is None else f"{found:.{digits}f}"


def table(file: str, path: str, *columns: str, **where: Any) -> str:  # noqa: ANN401
    """Return a list of records in a result as a table, with the command that makes it.

    Args:
        file: Name of the result.
        path: Dotted path of the list, or of one record.
        columns: See ``Column``; default: every key of the first record.
        where: Show only records with these entries.
    """
    rows = _rows(file, path, where)
    shown = [Column.parse(text) for text in columns or rows[0]]
    cells = [[column.cell(row) for column in shown] for row in rows]
    return grid([column.title for column in shown], cells) + origin(file)


def pivot(file: str, path: str, row: str, column: str, cell: str, **where: Any) -> str:  # noqa: ANN401
    """Return records as a table with a line for each value of one key, a column per other.

    Args:
        file: Name of the result.
        path: Dotted path of the list.
        row: Key of the lines.
        column: Key of the columns.
        cell: How a record's entries are shown, e.g. ``{score:.0%}``.
        where: Show only records with these entries.
    """
    cells = {(r[row], r[column]): _formatted(cell, r) for r in _rows(file, path, where)}
    titles = list(dict.fromkeys(title for _, title in cells))
    lines = [
        [str(key), *(cells[key, t] for t in titles)] for key in dict.fromkeys(k for k, _ in cells)
    ]
    return grid([row, *map(str, titles)], lines) + origin(file)


def _formatted(cell: str, row: dict[str, Any]) -> str:
    try:
        return cell.format(**row)
    except TypeError:  # a number that does not exist
        return number(None)


def _rows(file: str, path: str, where: dict[str, Any]) -> list[dict[str, Any]]:
    found = pick(read(file), path)
    records = found if isinstance(found, list) else [found]
    rows = [r for r in records if all(r[k] == v for k, v in where.items())]
    if not rows:
        raise PluginError(f"The result {file} has no rows at '{path}' with {where}.")
    return rows


def stored(file: str, path: str = "", **where: Any) -> bool:  # noqa: ANN401
    """Return whether a result is there and holds something at a path, with these entries."""
    study, name = file.split("/")
    if not (STUDIES / study / "results" / name).is_file():
        return False
    try:
        found = pick(read(file), path)
        rows = found if where else []
        return any(all(r[k] == v for k, v in where.items()) for r in rows) if where else bool(found)
    except (LookupError, TypeError):
        return False


def latest(file: str, path: str, by: str, *columns: str) -> str:
    """Return the last of a list of records for each value of a key as a table."""
    rows = {row[by]: row for row in _rows(file, path, {})}
    shown = [Column.parse(text) for text in (by, *columns)]
    cells = [[column.cell(row) for column in shown] for row in rows.values()]
    return grid([column.title for column in shown], cells) + origin(file)


def tables(study: str) -> str:
    """Return where the tables of a study stand."""
    return f"The tables stand in `studies/{study}/README.md`.\n"


def zero_shot(kind: str) -> str:
    """Return where the shares of controllers on legs that they never met stand."""
    return tables("sim_to_real")


def limits(study: str) -> str:
    """Return the section Limits of a study's README."""
    text = (STUDIES / study / "README.md").read_text(encoding="utf-8")
    return text.partition("\n## Limits\n")[2].partition("\n## ")[0].strip()


def not_stored(study: str) -> str:
    """Return what stands in place of results that are not there."""
    return f"No results are stored here; `python -m studies.{study} --results` measures them.\n"


def training(recipe: str) -> str:
    """Return accuracy over the time of a recipe's trainings: a table and a learning curve."""
    files = [f"time_to_accuracy/{kind}.json" for kind in ("distillation", "reinforcement_learning")]
    file = next((file for file in files if stored(file, "summary", recipe=recipe)), None)
    if file is None:
        return not_stored("time_to_accuracy")
    titles = (
        "seconds=after, s",
        "runs=trainings",
        "mean_error_m*1000=error, mm",
        "worst_seed_mean_error_m*1000=error of the worst training, mm",
        "mean_std_m*1000=std, mm",
        "skipped_hops=skipped hops",
    )
    rows = _rows(file, "summary", {"recipe": recipe})
    columns = [Column.parse(title) for title in titles]
    cells = [[column.cell(row) for column in columns] for row in rows]
    shown = cells if len(cells) <= _MOST_POINTS else cells[-1:]
    lines = curve(file, "rows", "mean_abs_median_error_m", "mean |error| / mm", recipe=recipe)
    return f"{grid([column.title for column in columns], shown)}\n\n{lines}{origin(file)}"


_MOST_POINTS = 4
"""Points in time that a table of a training shows; of more, the last."""


def curve(file: str, path: str, key: str, axis: str, **where: Any) -> str:  # noqa: ANN401
    """Return a learning curve as an inline figure: a length over time, a line for each seed.

    Args:
        file: Name of the result.
        path: Dotted path of the records, in order of time.
        key: What is drawn, in m, on a logarithmic axis in mm.
        axis: Label of that axis.
        where: Draw only records with these entries.
    """
    figure, ((axes,),) = figure_style.panels(1, height=3.0)
    records = _rows(file, path, where)
    for index, seed in enumerate(dict.fromkeys(r["seed"] for r in records)):
        mine = [r for r in records if r["seed"] == seed]
        axes.plot(
            [r["seconds"] / 60 for r in mine],
            [1000 * r[key] for r in mine],
            ".-",
            color=figure_style.colour(index),
            label=f"seed {seed}",
        )
    figure_style.plain_log(axes, "y")
    axes.set(xlabel="wall-clock time / min", ylabel=axis)
    axes.legend()
    svg = figure_style.to_svg(figure).decode()
    return svg[svg.index("<svg") :].replace("\n", "") + "\n"


def entries(file: str) -> str:
    """Return the numbers of a result as a table."""
    content = read(file)
    lines = [[f"`{k}`", number(v)] for k, v in content.items() if isinstance(v, int | float)]
    return grid(["name", "value"], lines) + origin(file)


def percentiles(file: str, **titles: str) -> str:
    """Return entries that hold percentiles as a table, a line each.

    Args:
        file: Name of the result.
        titles: Entry to what is measured.
    """
    content = read(file)
    names = list(content[next(iter(titles))])
    rows = [[title, *(number(content[entry][n]) for n in names)] for entry, title in titles.items()]
    return grid(["", *names], rows) + origin(file)


def bullets(file: str, path: str) -> str:
    """Return a list of sentences in a result as a list."""
    return "\n".join(f"- {sentence}" for sentence in pick(read(file), path))


def precision(file: str, high: float = 1.0) -> str:
    """Return how near hops come to commands up to the highest, m: a row per controller, in mm."""
    rows = []
    for name, one in accuracies(read(file)["summary"], high).items():
        values = astuple(one)
        cells = [*(1e3 * v for v in values[:5]), *values[5:8], *(100 * v for v in values[8:])]
        rows.append([name, *map(number, cells)])
    titles = [
        "controller", "worst error, mm", "mean", f"worst std up to {LOWER} m", "of all",
        "mean std", "skipped hops", "body contacts", "fewest hops/s", "least flight, %", "mean",
    ]  # fmt: skip
    return grid(titles, rows) + origin(file)


def front() -> str:
    """Return what a newcomer sees first: the legs, two commands, how well they hop."""
    seen, trained = "speed/view.json", "time_to_accuracy/distillation.json"
    training = _rows(trained, "summary", {"recipe": "fast"})[-1]
    command = "hop train --recipe fast --out runs/fast"
    soon = value(seen, "start_s", digits=0)
    return f"""\
![Two legs follow a staircase of commanded heights](results/evaluation/staircase.webp)

A learned policy, `{BEST}`, beside `{ENERGY_SHAPING}`, the classical controller.
Made by `python -m studies.evaluation.staircase`.

On Debian with Python 3.11 (and its `venv`), make and git:

```bash
make install
. .venv/bin/activate
{"hop demo":{len(command)}}   # both hop in your browser after {soon} s; the first start compiles
{command}   # a policy of your own after {training["seconds"]:.0f} s
```

Times are those of {value(seen, "host.cores")} cores, from [`{seen}`](results/{seen}) and
[`{trained}`](results/{trained}).

{headline()}"""


def headline() -> str:
    """Return how close controllers hop on legs, with grounds, that they are not told of."""
    file = "sim_to_real/zero_shot_twins.json"
    columns = (
        "controller",
        "median_abs_error_m*1000=error, mm",
        "worst_abs_error_m*1000=at the worst, mm",
        "within_5mm*100=within 5 mm, %",
        "within_10mm*100=within 10 mm, %",
        "body_contacts=body contacts",
        "would_be_stopped*100=ended by the supervisor, %",
    )
    return (
        f"{value(file, 'legs')} simulated legs and their grounds, which differ from the robot file"
        f" that is told, at commands that `{MPC_TRUE_STATE}` reaches; it knows everything:\n\n"
        f"{table(file, 'summary', *columns)}"
    )


def against(file: str, rival: str) -> str:
    """Return at how many commands controllers beat a rival: a row per controller.

    Of all commands, and of those at which the rival flies for half of the time.
    One is smaller than the other where their intervals over runs do not overlap.
    """
    rows_of: dict[str, dict[float, dict[str, Any]]] = {}
    for row in read(file)["summary"]:
        rows_of.setdefault(row["controller"], {})[row["command_m"]] = row
    other = rows_of.pop(rival)
    flying = [command for command, row in other.items() if row["flight_fraction"] >= LEAST_FLIGHT]
    rows = [
        [
            name,
            *(
                _told_apart([(mine[c], other[c]) for c in commands], measure)
                for commands in (list(other), flying)
                for measure in ("mean_abs_error", "std")
            ),
        ]
        for name, mine in rows_of.items()
    ]
    half = f"where `{rival}` flies {100 * LEAST_FLIGHT:.0f} %"
    titles = ["controller", "mean distance", "std", f"mean distance, {half}", f"std, {half}"]
    return grid(titles, rows) + origin(file)


def _told_apart(pairs: list[tuple[dict[str, Any], dict[str, Any]]], measure: str) -> str:
    low, high = f"{measure}_low_m", f"{measure}_high_m"
    known = [pair for pair in pairs if None not in (pair[0][low], pair[1][low])]
    less = sum(mine[high] < other[low] for mine, other in known)
    more = sum(other[high] < mine[low] for mine, other in known)
    return f"smaller at {less}, larger at {more}, not told apart at {len(pairs) - less - more}"


def one(
    file: str,
    path: str,
    key: str,
    factor: float = 1.0,
    digits: int = 1,
    **where: Any,  # noqa: ANN401
) -> str:
    """Return one number of the record in a list that has these entries, times a factor."""
    (row,) = _rows(file, path, where)
    if row[key] is None:
        return number(None)
    return (
        f"{row[key] * factor:+.{digits}f}" if "error" in key else f"{row[key] * factor:.{digits}f}"
    )


def separation(file: str, controller: str) -> str:
    """Return how neighbouring commands of a controller differ, the least distinct pair of them."""
    (found,) = _rows(file, "neighbours", {"controller": controller})
    pairs = found["neighbours"]
    if any(pair[name] is None for pair in pairs for name in ("p", "pooled_p", "cliffs_delta")):
        return "not all commands gave hops"
    p, pooled = (max(pair[name] for pair in pairs) for name in ("p", "pooled_p"))
    delta = min(pairs, key=lambda pair: pair["cliffs_delta"])
    interval = f"{delta['cliffs_delta_low']:.2f} to {delta['cliffs_delta_high']:.2f}"
    return (
        f"p {_p(pooled)} (pooled), p {_p(p)} (run by run); Cliff's delta"
        f" {delta['cliffs_delta']:.2f} ({interval});"
        f" overlap {100 * max(pair['overlap'] for pair in pairs):.0f} %"
    )


def _p(value: float) -> str:
    return "< 0.001" if value < 1e-3 else f"= {value:.3f}"


def heading(study: str) -> str:
    """Return the heading of a study's README."""
    text = (STUDIES / study / "README.md").read_text(encoding="utf-8")
    return text.partition("\n")[0].removeprefix("# ")


def pictures(study: str) -> list[str]:
    """Return the names of a study's figures."""
    return sorted(path.name for path in (STUDIES / study / "figures").glob("*.svg"))


def commands() -> dict[str, str]:
    """Return the command behind every result, by its name."""
    files = [f"{p.parts[-3]}/{p.name}" for p in sorted(STUDIES.glob("*/results/*.json"))]
    return {file: read(file)["command"] for file in files}


def origin(file: str) -> str:
    """Return the line under a table that says where it comes from."""
    return f"\n\nFrom [`{file}`](results/{file}), made by `{read(file)['command']}`.\n"


def grid(titles: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in lines
    )


MACROS = {
    "against": against,
    "bullets": bullets,
    "commands": commands(),
    "curve": curve,
    "entries": entries,
    "front": front,
    "heading": heading,
    "latest": latest,
    "limits": limits,
    "not_certified": not_certified,
    "not_stored": not_stored,
    "one": one,
    "percentiles": percentiles,
    "pictures": pictures,
    "pivot": pivot,
    "precision": precision,
    "safety_case": safety_case,
    "separation": separation,
    "stored": stored,
    "table": table,
    "tables": tables,
    "training": training,
    "value": value,
    "zero_shot": zero_shot,
}
