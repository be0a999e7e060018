"""One look for all figures: colour-blind safe, units on every axis, the same bytes every time."""

import functools
import io
from collections.abc import Callable
from typing import ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

P = ParamSpec("P")

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette, distinct for all common kinds of colour blindness."""

COMMAND_COLOUR = "0.45"
"""Of commanded heights, as in the paper."""

TORQUE_MAP = "PuOr_r"
"""Diverging and colour-blind safe; white is no torque."""

WIDTH = 8.0
"""Of a figure, inches."""

_LOOK = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.92",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.hashsalt": "hopping-leg",
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Give a drawing function the common look without touching anyone's settings."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(_LOOK):
            return draw(*args, **kwargs)

    return wrapper


def panels(rows: int, columns: int = 1, height: float = 2.2) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of panels that share their axes.

    Args:
        rows: Of panels.
        columns: Of panels.
        height: Of a row, inches.
    """
    figure = Figure(figsize=(WIDTH, height * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    return figure, [list(row) for row in axes]


def colour(index: int) -> str:
    """Return the colour of the n-th controller."""
    return COLOURS[index % len(COLOURS)]


def to_svg(figure: Figure) -> bytes:
    """Return a figure as SVG without a date, so that the same figure has the same bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context(_LOOK):
        figure.savefig(buffer, format="svg", dpi=160, metadata={"Date": None})
    return buffer.getvalue()


def to_png(figure: Figure, dpi: float = 130) -> bytes:
    """Return a figure as PNG of so many dots per inch."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
