"""One look for all figures: colour-blind safe, units on every axis, the same bytes every time."""

import functools
import io
from collections.abc import Callable
from typing import Literal, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from hopping_leg.colours import COLOURS

P = ParamSpec("P")

TORQUE_MAP = "PuOr_r"
"""Diverging and colour-blind safe; white is no torque."""

WIDTH = 8.0
"""Width of a figure, inches."""

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
    """Return a figure of panels that share their axes; a row's height is in inches."""
    figure = Figure(figsize=(WIDTH, height * rows + 0.5), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    return figure, [list(row) for row in axes]


def colour(index: int) -> str:
    """Return the colour of the n-th curve."""
    return COLOURS[index % len(COLOURS)]


def plain_log(axes: Axes, *sides: Literal["x", "y"]) -> None:
    """Make axes logarithmic, with plain numbers at 1, 2 and 5 of a decade; more on short ones."""
    for side in sides:
        getattr(axes, f"set_{side}scale")("log")
        axis = getattr(axes, f"{side}axis")
        low, high = axis.get_data_interval()
        marks = (1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 5, 6, 7, 8)
        axis.set_major_locator(LogLocator(10, marks))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_locator(NullLocator())


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


def to_pdf(figure: Figure) -> bytes:
    """Return a figure as PDF without a date, its fonts embedded."""
    buffer = io.BytesIO()
    with mpl.rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format="pdf", metadata={"CreationDate": None})
    return buffer.getvalue()


ENCODERS = {"svg": to_svg, "pdf": to_pdf, "png": to_png}
"""What makes a file's content of a figure, by the file's suffix."""
