"""What verbs share: types and checks of options, the command behind a result, printed tables."""

import contextlib
import dataclasses
import shlex
import sys
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import tyro
from rich.table import Column, Table

from hopping_leg import io
from hopping_leg.errors import TraceError, UsageError
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.terminal import plain_console, print_table

Heights = Annotated[tuple[float, ...], tyro.conf.arg(metavar="M ...")]
"""Heights in metres."""
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
            flag = name.replace("_", "-")
            raise UsageError(f"--{flag} is {value} but must be {least} or more.")


def save_json(path: Path | None, value: object) -> None:
    """Write a result if a file was named; print it if it cannot be written after all."""
    try:
        if path is not None:
            io.write_json(path, value)
    except TraceError:
        say(io.json_text(value))
        raise


@contextlib.contextmanager
def going_on(how: str) -> Iterator[None]:
    """Say how to go on where work is interrupted, or something cannot be written."""
    try:
        yield
    except (KeyboardInterrupt, OSError, TraceError):
        with contextlib.suppress(OSError):  # the terminal may be gone
            print(f"Stopped; {how}", file=sys.stderr)
        raise


def mm(metres: float | None) -> str:
    """Return a length in mm as a table shows it."""
    return "no hops" if metres is None else f"{metres * 1e3:.2f}"


def say(*lines: object) -> None:
    """Print lines as they are, unwrapped and without markup."""
    for line in lines:
        plain_console().print(str(line), soft_wrap=True)


def say_written(*paths: Path | None) -> None:
    """Say where files were written."""
    say(*(f"Wrote {path}" for path in paths if path))


def say_next(*commands: Iterable[object]) -> None:
    """Say what may come next: commands that the shell reads and that work as they stand."""
    say("Next:", *(f"  {shlex.join(map(str, words))}" for words in commands))


def show_table(
    columns: Iterable[Column | str], rows: Iterable[Iterable[object]], title: str | None = None
) -> None:
    """Print a table of cells as they are, without markup."""
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*map(str, row))
    print_table(table)


KEPT = frozenset({"out", "folder", "figure", "resume", "jobs", "ray"})
"""Options that only say where results are kept and who computes them."""


def command_line(verb: str, args: Any, leave_out: Collection[str] = KEPT) -> str:  # noqa: ANN401
    """Return a command whose options have the values of a dataclass, as the shell reads it.

    Defaults are left out; options of dataclasses among the fields stand beside the others.
    """
    before, behind = verb.split(), []
    for name, value, hint in _given(args, leave_out):
        flag = f"--{name.replace('_', '-')}"
        if isinstance(value, bool):
            behind.append(flag if value else f"--no-{flag[2:]}")
        elif tyro.conf.Positional in getattr(hint, "__metadata__", ()):
            before += _words(value)
        else:
            behind += [flag, *_words(value)]
    return shlex.join([*before, *behind])


def _given(args: Any, leave_out: Collection[str]) -> Iterator[tuple[str, Any, Any]]:  # noqa: ANN401
    hints = get_type_hints(type(args), include_extras=True)
    for field in dataclasses.fields(args):
        value = getattr(args, field.name)
        if dataclasses.is_dataclass(value):
            yield from _given(value, leave_out)
        elif field.name not in leave_out and value != field.default:
            yield field.name, value, hints[field.name]


def _words(value: object) -> list[str]:
    return [str(entry) for entry in (value if isinstance(value, tuple | list) else [value])]
