"""Numbers of stored results in READMEs; ``python -m studies.readmes`` writes them all.

A study's ``TABLES`` name a macro of the documentation, a file of its results and what the macro
asks for; the last entry may be a dict of the records that count. The project's own README has what
the documentation's home page has, under badges.
"""

import importlib
import re
import sys
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import quote

from hopping_leg.io import write_atomically

ROOT = Path(__file__).parent.parent
START, END = "<!-- results -->\n", "<!-- /results -->\n"
PROJECT = ""
"""Stands for the project itself beside the names of studies."""

_RESULT = re.compile(r"\(results/(\w+)/([\w.]+)\)")


def readme(name: str) -> Path:
    """Return where a study's README is, or the project's."""
    return (ROOT / "studies" / name if name else ROOT) / "README.md"


def filled(name: str) -> str:
    """Return a README with its numbers as the stored results have them."""
    text = readme(name).read_text(encoding="utf-8")
    if START not in text:
        return text
    before, _, rest = text.partition(START)
    return before + START + (_tables(name) if name else _front()) + END + rest.partition(END)[2]


def _tables(name: str) -> str:
    tables: str = _macros().tables(name)
    return tables.replace(f"(results/{name}/", "(results/")


def _front() -> str:
    def stored(found: re.Match[str]) -> str:
        folder = "results" if found[2].endswith(".json") else "figures"
        return f"(studies/{found[1]}/{folder}/{found[2]})"

    return f"{_badges()}\n\n{_RESULT.sub(stored, _macros().front())}"


def _badges() -> str:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shown = (
        ("python", project["requires-python"], "pyproject.toml"),
        ("license", project["license"], "LICENSE"),
        ("paper", "IROS 2023", project["urls"]["Paper"]),
    )

    def words(text: str) -> str:
        return quote(text.replace("-", "--"))

    return "\n".join(
        f"[![{left}: {right}](https://img.shields.io/badge/{words(left)}-{words(right)}-0072B2)]({to})"
        for left, right, to in shown
    )


def _macros() -> Any:  # noqa: ANN401
    if (docs := str(ROOT / "docs")) not in sys.path:
        sys.path.append(docs)
    return importlib.import_module("macros_results")


def write(name: str) -> None:
    """Fill a study's README, or the project's."""
    write_atomically(readme(name), filled(name).encode())


if __name__ == "__main__":
    write(PROJECT)
    for page in sorted(ROOT.glob("studies/*/README.md")):
        write(page.parent.name)
