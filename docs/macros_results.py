"""Numbers and tables from docs/results, each with the command that makes it."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError

RESULTS = Path(__file__).parent / "results"
MAKEFILE = Path(__file__).parent.parent / "Makefile"

_FOREACH = r"\$\(foreach (\w+),([^,]*),((?:\$\(\w+\)|[^()])*)\)"
"""Of make: a variable, its values and the text that is repeated."""


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
    """Return the names of all figures that ``hop report figures`` left in docs/results/figures."""
    return sorted(path.name for path in (RESULTS / "figures").glob("*.svg"))


def origin(file: str, content: Any) -> str:  # noqa: ANN401
    """Return the line under a table that says where it comes from."""
    command = content.get("command") if isinstance(content, dict) else None
    command = command or commands().get(file)
    made = f", made by `{command}`" if command else ""
    return f"\n\nFrom [`{file}`](results/{file}){made}.\n"


def commands() -> dict[str, str]:
    """Return the command behind each results file, as ``make results`` runs it."""
    text = MAKEFILE.read_text(encoding="utf-8").replace("\\\n", " ").replace("$(BIN)/", "")
    for name, meaning in re.findall(r"^(\w+) := (.*)$", text, re.MULTILINE):
        text = text.replace(f"$({name})", meaning)
    text = re.sub(_FOREACH, _each, text)
    found = {}
    for line in text.splitlines():
        target = re.search(r"--json docs/results/(\S+)", line)
        if target:
            found[target[1]] = " ".join(line.split())
    return found


def _each(match: re.Match[str]) -> str:
    """Return what make's ``foreach`` comes to."""
    name, words, body = match.groups()
    return " ".join(body.replace(f"$({name})", word) for word in words.split())


def grid(titles: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in lines
    )


MACROS = {
    "bullets": bullets,
    "commands": commands(),
    "entries": entries,
    "exists": exists,
    "pictures": pictures,
    "table": table,
    "value": value,
}
