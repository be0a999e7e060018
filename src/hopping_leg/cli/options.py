"""What verbs share: types and checks of options, printed lines and tables."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import tyro
from rich.table import Column, Table

from hopping_leg import io
from hopping_leg.errors import UsageError
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.terminal import plain_console, print_table

Heights = Annotated[tuple[float, ...], tyro.conf.arg(metavar="M ...")]  # Heights in metres
RobotFile = Annotated[str, tyro.conf.arg(help="A shipped robot or the path of a .toml file.")]
OwnRobot = Annotated[
    str | None,
    tyro.conf.arg(
        help="A shipped robot or the path of a .toml file; default: the one that the first policy"
        f" was trained on, else {DEFAULT_ROBOT}."
    ),
]
"""The robot of a verb that is given controllers."""
JsonFile = Annotated[
    Path | None, tyro.conf.arg(help="JSON file for every number, besides what is printed.")
]


def at_least(least: int, **values: int | None) -> None:
    """Refuse options below their least sensible value; None is an option that was not given."""
    for name, value in values.items():
        if value is not None and value < least:
            raise UsageError(f"--{name.replace('_', '-')} is {value} but must be {least} or more.")


def save_json(path: Path | None, value: object) -> None:
    """Write a result if a file was named."""
    if path is not None:
        io.write_json(path, value)


def answer(question: str) -> str | None:
    """Return what the user types on the terminal, None where there is none to ask on."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return None
    print(question, end=" ", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def say(*lines: object) -> None:
    """Print lines as they are, unwrapped and without markup."""
    for line in lines:
        plain_console().print(str(line), soft_wrap=True)


def say_written(*paths: Path | None) -> None:
    """Say where files were written."""
    say(*(f"Wrote {path}" for path in paths if path))


def show_table(
    columns: Iterable[Column | str], rows: Iterable[Iterable[object]], title: str | None = None
) -> None:
    """Print a table of cells as they are, without markup."""
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*map(str, row))
    print_table(table)
