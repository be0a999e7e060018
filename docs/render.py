"""Renders stored results, and what the package knows, into the Markdown of the repository.

``python docs/render.py`` rewrites what stands between ``<!-- render: EXPRESSION -->`` and
``<!-- /render -->`` in ``README.md``, ``docs/*.md`` and ``studies/*/README.md``; with ``--check``
it changes nothing and fails where a block is not current. An expression calls one of ``FUNCTIONS``
with literal arguments. A result is named ``STUDY/FILE``, e.g. ``speed/env.json``.
"""

import ast
import contextlib
import json
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
STUDIES = ROOT / "studies"
PAGES = ("README.md", "docs/*.md", "studies/*/README.md")

_BLOCK = re.compile(r"<!-- render: (.*?) -->\n.*?<!-- /render -->\n", re.DOTALL)
_NUMBER = re.compile(r"\{(\w+/[\w.]+):([\w.]+)(?:\*([\d.]+))?(?::([^}]+))?\}")


def table(file: str, path: str, *columns: str, last: str = "", **where: Any) -> str:  # noqa: ANN401
    """Return records of a result as a table, with the command that makes it.

    Args:
        file: Name of the result, or a pattern of several whose records follow each other.
        path: Dotted path of the list, or of one record.
        columns: ``"key"``, ``"key=title"`` or ``"key*factor=title"``; a key that a record does not
            have is a dotted path in it.
        last: Show only the last record for each value of this key.
        where: Show only records with these entries, or with one of a list of entries.
    """
    rows = _rows(file, path, where)
    if last:
        rows = list({row[last]: row for row in rows}.values())
    found = [_column(text) for text in columns]
    lines = [[_cell(row, key, factor) for key, factor, _ in found] for row in rows]
    return grid([title for _, _, title in found], lines) + _origin(file)


def pivot(file: str, path: str, row: str, column: str, cell: str, **where: Any) -> str:  # noqa: ANN401
    """Return records as a table with a line for each value of one key, a column per other.

    Args:
        file: Name of the result.
        path: Dotted path of the list.
        row: Key of the lines.
        column: Key of the columns.
        cell: How a record's entries are shown, e.g. ``{score:.0%}``; a name that ends in ``_mm`` is
            the entry in ``_m``, in mm.
        where: Show only records with these entries.
    """
    cells = {}
    for r in _rows(file, path, where):
        mm = {f"{k}m": 1e3 * v for k, v in r.items() if k.endswith("_m") and isinstance(v, float)}
        with contextlib.suppress(KeyError, TypeError):  # a number that does not exist
            cells[r[row], r[column]] = cell.format(**r, **mm)
    titles = list(dict.fromkeys(title for _, title in cells))
    keys = dict.fromkeys(key for key, _ in cells)
    lines = [[str(key), *(cells.get((key, title), "–") for title in titles)] for key in keys]
    return grid([row.removesuffix("_m"), *map(str, titles)], lines) + _origin(file)


def say(text: str) -> str:
    """Return sentences with numbers of results for each ``{STUDY/FILE:PATH*FACTOR:FORMAT}``."""

    def filled(found: re.Match[str]) -> str:
        file, path, factor, style = found.groups()
        value = pick(read(file), path)
        value = value * float(factor) if factor else value
        return format(value, style) if style else number(value)

    return _NUMBER.sub(filled, text)


def precision(file: str) -> str:
    """Return how near hops come to commands: a row per controller, lengths in mm."""
    from studies.evaluation.accuracy import accuracies

    rows = []
    for name, one in accuracies(read(file)["summary"]).items():
        values = list(one.values())
        cells = [*(1e3 * v for v in values[:4]), *values[4:7], *(100 * v for v in values[7:])]
        rows.append([name, *map(number, cells)])
    titles = [
        "controller", "worst error, mm", "mean", "worst std, mm", "mean", "skipped hops",
        "body contacts", "fewest hops/s", "least flight, %", "mean",
    ]  # fmt: skip
    return grid(titles, rows) + _origin(file)


def safety_case() -> str:
    """Return the table of the safety case, from the fault campaign's families and results."""
    from studies.fault_campaign import safety_case

    lines = []
    stored = [read(f"fault_campaign/{name}.json") for name in ("fault_campaign", "lies", "healthy")]
    for row in safety_case.rows(*stored):
        within, most = row["within_s"], row["upper_bound"]
        times = number(within and 1e3 * within), row["trials"], row["unsafe"]
        shown = "–" if most is None else f"{100 * most:.2g} %"
        lines.append([*(row[k] for k in ("fault", "noticed_by", "follows")), *times, shown])
    titles = ["fault", "noticed by", "then", "within, ms", "trials", "unsafe", "at most, 95 %"]
    return grid(titles, lines)


def verbs() -> str:
    """Return the verbs of ``hop`` and their jobs as a table."""
    from hopping_leg.cli import VERBS

    return grid(["verb", "job"], [[f"`hop {verb}`", job] for verb, job in VERBS.items()])


def trace_columns() -> str:
    """Return the columns that every trace has as a table."""
    from hopping_leg.trace import COLUMNS

    return grid(["column", "meaning"], [[f"`{name}`", text] for name, text in COLUMNS.items()])


def robustness_axes() -> str:
    """Return the axes of the robustness benchmark as a table."""
    from hopping_leg.evaluate.robustness_axes import AXES

    rows = []
    for axis in AXES:
        unit = "" if axis.unit == "1" else f", {axis.unit}"
        levels = ", ".join(f"{level:g}" for level in axis.levels)
        drawn = "{:g} to {:g}".format(*axis.moderate)
        rows.append([f"`{axis.name}`", axis.meaning + unit, levels, axis.leaderboard, drawn])
    return grid(["axis", "a level is", "levels", "R", "in `joint`"], rows)


def example(file: str) -> str:
    """Return a file of ``examples/`` as a block of code."""
    language = {".py": "python", ".toml": "toml"}[Path(file).suffix]
    text = (ROOT / "examples" / file).read_text(encoding="utf-8").rstrip()
    return f"```{language}\n{text}\n```"


FUNCTIONS: dict[str, Callable[..., str]] = {
    function.__name__: function
    for function in (
        table, pivot, say, precision, safety_case, verbs, trace_columns, robustness_axes, example
    )
}  # fmt: skip


def grid(titles: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a Markdown table."""
    titles = list(titles)
    lines = [titles, ["---"] * len(titles), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in row] for row in lines)
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


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


def _column(text: str) -> tuple[str, float | None, str]:
    left, _, title = text.partition("=")
    key, _, factor = left.partition("*")
    return key, float(factor) if factor else None, title or key


def _cell(row: dict[str, Any], key: str, factor: float | None) -> str:
    value = row[key] if key in row else pick(row, key)
    values = value if isinstance(value, list) else [value]
    return ", ".join(number(v if factor is None or v is None else factor * v) for v in values)


def _files(pattern: str) -> list[str]:
    study, name = pattern.split("/")
    return [f"{study}/{path.name}" for path in sorted((STUDIES / study / "results").glob(name))]


def _rows(pattern: str, path: str, where: dict[str, Any]) -> list[dict[str, Any]]:
    def counts(row: dict[str, Any]) -> bool:
        return all(row[k] in v if isinstance(v, list) else row[k] == v for k, v in where.items())

    found = [pick(read(file), path) for file in _files(pattern)]
    records = [row for one in found for row in (one if isinstance(one, list) else [one])]
    rows = [row for row in records if counts(row)]
    if not rows:
        raise LookupError(f"The result {pattern} has no rows at '{path}' with {where}.")
    return rows


def _origin(pattern: str) -> str:
    """Return the line under a table that says where it comes from; links begin at the root."""
    files = _files(pattern)
    links = ", ".join(f"[`{file}`](/studies/{file.replace('/', '/results/')})" for file in files)
    made = f", made by `{read(files[0])['command']}`" if len(files) == 1 else ""
    return f"\n\nFrom {links}{made}."


def rendered(expression: str) -> str:
    """Return what an expression renders; its links begin at the root of the repository."""
    call = ast.parse(expression.strip(), mode="eval").body
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        raise ValueError(f"No call of a function: {expression}")
    arguments = [ast.literal_eval(one) for one in call.args]
    named = {one.arg or "": ast.literal_eval(one.value) for one in call.keywords}
    return FUNCTIONS[call.func.id](*arguments, **named)


def page(path: Path) -> str:
    """Return the text of a page with all its blocks as they are today."""
    root = "../" * (len(path.relative_to(ROOT).parts) - 1)

    def block(found: re.Match[str]) -> str:
        try:
            text = rendered(found[1]).strip().replace("](/", f"]({root}")
        except Exception as error:
            error.add_note(f"in {path.relative_to(ROOT)}: {found[1]}")
            raise
        return f"<!-- render: {found[1]} -->\n\n{text}\n\n<!-- /render -->\n"

    return _BLOCK.sub(block, path.read_text(encoding="utf-8"))


def main(words: list[str]) -> int:
    """Rewrite all pages, or with ``--check`` name those that are not current."""
    sys.path[:0] = [str(ROOT), str(ROOT / "src")]
    stale = []
    for path in sorted(path for pattern in PAGES for path in ROOT.glob(pattern)):
        text = page(path)
        if text != path.read_text(encoding="utf-8"):
            stale.append(str(path.relative_to(ROOT)))
            if "--check" not in words:
                path.write_text(text, encoding="utf-8")
    if stale and "--check" in words:
        print(f"Not current: {', '.join(stale)}. Run `python docs/render.py`.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
