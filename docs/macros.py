"""Fills documentation pages with numbers from docs/results and from the package, at build time.

A page may hold ``{{ table(...) }}``, ``{{ value(...) }}``, ``{{ robot(...) }}``,
``{{ usage(...) }}`` and the like; a missing file or entry stops the build, so no page can show a
number that no longer exists.
"""

import contextlib
import dataclasses
import io
import json
import math
import os
import re
from pathlib import Path
from typing import Any

import jinja2
from mkdocs.exceptions import PluginError

from hopping_leg import cli
from hopping_leg.cli.robots import derived, numbers
from hopping_leg.deploy.emulator.faults import KINDS
from hopping_leg.evaluate.faults.families import FAMILIES
from hopping_leg.evaluate.robustness.axes import AXES
from hopping_leg.robot import load_robot
from hopping_leg.robot.files import load_tree
from hopping_leg.sim.twins import TWIN_RANGES
from hopping_leg.trace import COLUMNS

RESULTS = Path(__file__).parent / "results"
MAKEFILE = Path(__file__).parent.parent / "Makefile"
EXAMPLES = Path(__file__).parent.parent / "examples"


@dataclasses.dataclass(frozen=True)
class Column:
    """A column ``"key"``, ``"key=title"`` or ``"key*factor=title"`` of a table."""

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
        return number(scaled(row[self.key], self.factor))


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
    """Return the content of a file in docs/results."""
    return json.loads((RESULTS / file).read_text(encoding="utf-8"))


def pick(tree: Any, path: str) -> Any:  # noqa: ANN401
    """Return the entry at a dotted path; numbers index lists, an empty path is the whole."""
    for key in filter(None, path.split(".")):
        tree = tree[int(key)] if isinstance(tree, list) else tree[key]
    return tree


def value(file: str, path: str, factor: float | None = None, digits: int | None = None) -> str:
    """Return one number of a results file, times a factor, with so many digits after the point."""
    found = scaled(pick(read(file), path), factor)
    return number(found) if digits is None else f"{found:.{digits}f}"


def table(file: str, path: str, *columns: str, **where: Any) -> str:  # noqa: ANN401
    """Return a list of records in a results file as a table, with the command that makes it.

    Args:
        file: In docs/results.
        path: Dotted path of the list.
        columns: See ``Column``; default: every key of the first record.
        where: Show only records with these entries.
    """
    content = read(file)
    rows = [row for row in pick(content, path) if all(row[k] == v for k, v in where.items())]
    if not rows:
        raise PluginError(f"docs/results/{file} has no rows at '{path}' with {where}.")
    shown = [Column.parse(text) for text in columns or rows[0]]
    cells = [[column.cell(row) for column in shown] for row in rows]
    return grid([column.title for column in shown], cells) + origin(file, content)


def bullets(file: str, path: str) -> str:
    """Return a list of sentences in a results file as a list."""
    return "\n".join(f"- {sentence}" for sentence in pick(read(file), path))


def entries(file: str) -> str:
    """Return every number of a results file with its path; lists of records are tables."""
    content = read(file)
    return "\n\n".join(_parts(content, "")) + origin(file, content)


def _parts(tree: dict[str, Any], prefix: str) -> list[str]:
    plain = [[f"`{prefix}{k}`", number(v)] for k, v in tree.items() if not _is_nested(v)]
    parts = [grid(["name", "value"], plain)] if plain else []
    for key, entry in tree.items():
        if isinstance(entry, dict):
            parts += _parts(entry, f"{prefix}{key}.")
        elif _is_nested(entry):
            columns = [Column.parse(name) for name in entry[0]]
            rows = [[column.cell(row) for column in columns] for row in entry]
            parts += [f"`{prefix}{key}`:", grid([column.title for column in columns], rows)]
    return parts


def _is_nested(entry: Any) -> bool:  # noqa: ANN401
    records = isinstance(entry, list) and bool(entry) and isinstance(entry[0], dict)
    return isinstance(entry, dict) or records


def exists(file: str, path: str = "") -> bool:
    """Tell whether a results file, and an entry that is not empty in it, has been measured."""
    try:
        return bool(pick(read(file), path))
    except (OSError, LookupError):
        return False


def pictures() -> list[str]:
    """Return the names of all figures that ``hop plot`` left in docs/results/figures."""
    return sorted(path.name for path in (RESULTS / "figures").glob("*.svg"))


def origin(file: str, content: Any) -> str:  # noqa: ANN401
    """Return the line under a table that says where it comes from."""
    command = content.get("command") if isinstance(content, dict) else None
    command = command or commands().get(file)
    made = f", made by `{command}`" if command else ""
    return f"\n\nFrom [`{file}`](results/{file}){made}.\n"


def commands() -> dict[str, str]:
    """Return the command behind each results file, as ``make results`` runs it."""
    text = MAKEFILE.read_text(encoding="utf-8").replace("\\\n", " ")
    found = {}
    for line in text.splitlines():
        target = re.search(r"--json docs/results/(\S+)", line)
        if target:
            found[target[1]] = " ".join(line.replace("$(BIN)/", "").split())
    return found


def grid(titles: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in lines
    )


def robot(name: str) -> str:
    """Return every number of a shipped robot as a table."""
    leg = load_robot(name)
    rows = [
        [f"`{path}`", f"{entry['value']:g}", entry["unit"], entry["source"]]
        for path, entry in numbers(load_tree(name))
    ]
    rows += [[f"`{path}`", number(entry), "", "computed"] for path, entry in derived(leg).items()]
    return grid(["number", "value", "unit", "source"], rows)


def trace_columns() -> str:
    """Return the columns that every trace has as a table; units are the ends of their names."""
    units = {"_m_s": "m/s", "_rad_s": "rad/s", "_rad": "rad", "_nm": "N m", "_s": "s", "_m": "m"}
    rows = [
        [f"`{name}`", next(unit for end, unit in units.items() if name.endswith(end)), meaning]
        for name, meaning in COLUMNS.items()
    ]
    return grid(["column", "unit", "meaning"], rows)


def search_space(recipe: str) -> str:
    """Return what `hop tune` searches of a recipe as a table."""
    from hopping_leg.learn.recipes import get_recipe
    from hopping_leg.learn.search_space import SPACES, OneOf, dimensions

    rows, shipped = [], get_recipe(recipe)
    for name, found in dimensions(SPACES[recipe]).items():
        if isinstance(found, OneOf):
            where = ", ".join(str(found.stored(choice)) for choice in found.choices)
        else:
            values = dataclasses.asdict(found)  # type: ignore[call-overload]
            where = "{low:g} to {high:g}".format(**values) + (", log" if values["log"] else "")
        rows.append([f"`{name}`", where, str(found.stored(getattr(shipped, name)))])
    return grid(["number", "searched", "recipe"], rows)


def probe_scores(file: str, controller: str) -> str:
    """Return a policy's probes: a row per set of features, a column per target."""
    content = read(file)
    own = [row for row in content["rows"] if row["controller"] == controller]
    targets = list(dict.fromkeys(row["target"] for row in own))
    cells = {(row["features"], row["target"]): _scored(row) for row in own}
    rows = [
        [features, *(cells[features, target] for target in targets)]
        for features in dict.fromkeys(row["features"] for row in own)
    ]
    return grid(["read off", *targets], rows) + origin(file, content)


def _scored(row: dict[str, Any]) -> str:
    error = "" if row["rms"] is None else f", {row['rms']:.2g} {row['unit']}"
    return f"{row['score']:.2f} [{row['low']:.2f}, {row['high']:.2f}]{error}"


def twin_ranges() -> str:
    """Return the distribution of twins as a table."""
    rows = [
        [f"`{r.path}`", f"{r.low:g}", f"{r.high:g}", r.unit, r.scale, r.source] for r in TWIN_RANGES
    ]
    return grid(["number", "from", "to", "unit", "scale", "source"], rows)


def robustness_axes() -> str:
    """Return the axes of the robustness benchmark as a table."""
    rows = [
        [
            f"`{axis.name}`",
            axis.meaning,
            "" if axis.unit == "1" else axis.unit,
            ", ".join(f"{level:g}" for level in axis.levels),
            axis.leaderboard,
            "{:g} to {:g}".format(*axis.moderate),
        ]
        for axis in AXES
    ]
    return grid(["axis", "a level is", "unit", "levels", "R", "in `joint`"], rows)


def leaderboard(file: str) -> str:
    """Return the scores of a robustness file: a row per axis, a column per controller, in %."""
    content = read(file)
    controllers = list(dict.fromkeys(row["controller"] for row in content["scores"]))
    cells = {(row["axis"], row["controller"]): _share(row) for row in content["scores"]}
    rows = [
        [f"`{axis}`", *(cells[axis, name] for name in controllers)]
        for axis in dict.fromkeys(axis for axis, _ in cells)
    ]
    return grid(["axis", *controllers], rows) + origin(file, content)


def _share(row: dict[str, Any]) -> str:
    score, low, high = (f"{100 * row[key]:.0f}" for key in ("score", "low", "high"))
    return f"{score} [{low}, {high}]"


def fault_kinds() -> str:
    """Return what a fault script may name as a table."""
    rows = []
    for name, kind in KINDS.items():
        value = f"{kind.value:g} {kind.unit}" if kind.unit else ""
        if math.isnan(kind.duration):
            lasts = "`count` replies"
        else:
            lasts = "on" if math.isinf(kind.duration) else f"{kind.duration:g} s"
        rows.append([f"`{name}`", kind.text, value, lasts])
    return grid(["kind", "what happens", "value by default", "lasts"], rows)


def fault_families() -> str:
    """Return the campaign's families and for which reasons a run may end as a table."""
    rows = []
    for name, family in FAMILIES.items():
        reasons = ", ".join(sorted(reason.name for reason in family.reasons))
        nothing = "not armed" if family.refused else "the drives brake"
        rows.append([name, f"`{reasons}`" if reasons else nothing])
    return grid(["family", "correct ends"], rows)


def percentiles(file: str, **titles: str) -> str:
    """Return entries that hold percentiles as a table, a line each.

    Args:
        file: In docs/results.
        titles: Entry to what is measured.
    """
    content = read(file)
    names = list(content[next(iter(titles))])
    rows = [[title, *(number(content[entry][n]) for n in names)] for entry, title in titles.items()]
    return grid(["", *names], rows) + origin(file, content)


def usage(*arguments: str) -> str:
    """Return the help text of a command."""
    os.environ |= {"COLUMNS": "100", "NO_COLOR": "1"}
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        cli.main([*arguments, "--help"])
    return f"```text\n$ hop {' '.join((*arguments, '--help'))}\n{text.getvalue().rstrip()}\n```"


def example(file: str) -> str:
    """Return a file of examples/ as it is."""
    return (EXAMPLES / file).read_text(encoding="utf-8").rstrip()


def page(file: str, title: str) -> str:
    """Return a link to a page of this site, or its bare title where there is none."""
    return f"[{title}]({file})" if (Path(__file__).parent / file).is_file() else title


MACROS = {
    "table": table,
    "value": value,
    "robot": robot,
    "usage": usage,
    "trace_columns": trace_columns,
    "probe_scores": probe_scores,
    "search_space": search_space,
    "twin_ranges": twin_ranges,
    "robustness_axes": robustness_axes,
    "leaderboard": leaderboard,
    "percentiles": percentiles,
    "fault_kinds": fault_kinds,
    "fault_families": fault_families,
    "example": example,
    "page": page,
    "commands": commands(),
    "bullets": bullets,
    "entries": entries,
    "exists": exists,
    "pictures": pictures,
    "verbs": list(cli.VERBS),
}


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:  # noqa: ANN401
    """Fill one page (called by mkdocs)."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=False, keep_trailing_newline=True
    )
    try:
        return environment.from_string(markdown).render(MACROS)
    except (jinja2.TemplateError, OSError, LookupError, TypeError, ValueError) as error:
        raise PluginError(f"docs/{page.file.src_uri}: {type(error).__name__}: {error}") from error
