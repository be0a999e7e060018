"""One look for all figures: colour-blind safe, units on every axis, the same bytes every time.

A controller has one colour in figures, reports, the viewer and the live page.
"""

import functools
import io
from collections.abc import Callable, Iterable
from typing import Literal, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

P = ParamSpec("P")

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette, distinct for all common kinds of colour blindness."""

COMMAND = "#737373"  # Of commanded heights

_OF_CONTROLLERS = {
    "rl": "#0072B2", "energy-shaping": "#D55E00", "fast": "#009E73", "universal": "#CC79A7",
    "energy-shaping-tuned": "#56B4E9", "energy-shaping-flying": "#E69F00",
    "energy-shaping-literal": "#8C510A", "mpc-true-state": "#8A7A00", "paper": "#7A5AA6",
}  # fmt: skip
"""Of the shipped ones, whatever stands beside them."""


def controller_colours(names: Iterable[str]) -> dict[str, str]:
    """Return the colour of each controller as ``#rrggbb``: its own, else the next that is free."""
    shown = list(dict.fromkeys(names))
    found = {name: _OF_CONTROLLERS[name] for name in shown if name in _OF_CONTROLLERS}
    free = [colour for colour in COLOURS if colour not in found.values()] or list(COLOURS)
    others = [name for name in shown if name not in found]
    found |= {name: free[index % len(free)] for index, name in enumerate(others)}
    return {name: found[name] for name in shown}


def rgb(colour: str) -> tuple[int, int, int]:
    """Return a colour ``#rrggbb`` as numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


TORQUE_MAP = "PuOr_r"  # Diverging and colour-blind safe; white is no torque
WIDTH = 8.0  # Width of a figure, inches

_LOOK = {
    "font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left", "axes.spines.top": False,
    "axes.spines.right": False, "axes.grid": True, "grid.color": "0.92", "grid.linewidth": 0.8,
    "axes.axisbelow": True, "legend.frameon": False, "legend.fontsize": 8,
    "svg.hashsalt": "hopping-leg",
}  # fmt: skip


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Give a drawing function the common look without touching anyone's settings."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(_LOOK):
            return draw(*args, **kwargs)

    return wrapper


def panels(rows: int, columns: int = 1) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of panels that share their axes."""
    figure = Figure(figsize=(WIDTH, 2.2 * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    return figure, [list(row) for row in axes]


def encode(figure: Figure, kind: Literal["svg", "pdf", "png"], dpi: float = 160) -> bytes:
    """Return a figure as a file's content, without a date: the same one has the same bytes."""
    dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}
    buffer = io.BytesIO()
    with mpl.rc_context({**_LOOK, "pdf.fonttype": 42}):  # embeds the fonts
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=dates[kind])
    return buffer.getvalue()
