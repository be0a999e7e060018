"""What is printed: texts as they are, tables with whole values, no character that ends it."""

import contextlib
import io
import sys

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

_WIDEST = 10_000


def accept_any_text() -> None:
    """Let the standard streams replace what their encoding does not know, e.g. ASCII."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, io.UnsupportedOperation):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]


def plain_console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that takes no part of a text for markup or emoji."""
    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False, highlight=False)


def print_table(table: Table, console: Console | None = None) -> None:
    """Print a table, beyond a narrow terminal's edge rather than without parts of its values."""
    console = console or plain_console()
    for column in table.columns:
        words = [str(text).split() for text in (column.header, *column.cells)]
        longest = max((cell_len(word) for line in words for word in line), default=0)
        column.min_width = max(longest, column.min_width or 0)
    least = console.measure(table, options=console.options.update(max_width=_WIDEST)).minimum
    console.print(table, width=max(console.width, least), crop=False)
