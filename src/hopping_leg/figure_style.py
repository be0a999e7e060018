"""One look for all figures: colour-blind safe, units on every axis, the same bytes every time.

For print, figures get the width of a paper's column or page and text that stays readable there.
"""

import functools
import io
import math
from collections.abc import Callable
from typing import Literal, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
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


Format = Literal["svg", "pdf", "png"]
Width = Literal["screen", "column", "page"]

INCHES = {"column": 3.5, "page": 7.16}
"""Width of a column and of the page in IEEE's two-column format."""

_SMALLER = {"column": 7 / 9, "page": 8 / 9}
"""Text and lines relative to the screen's, whose text is 9 pt."""

_PRINT_DPI = 300


def encode(figure: Figure, kind: Format, width: Width = "screen") -> bytes:
    """Return a figure as a file's content, the same bytes every time, resized for print.

    Fonts are embedded in a PDF.
    """
    if width != "screen":
        fit_width(figure, width)
    if kind == "svg":
        return to_svg(figure)
    if kind == "pdf":
        buffer = io.BytesIO()
        with mpl.rc_context({"pdf.fonttype": 42}):
            figure.savefig(buffer, format="pdf", dpi=_PRINT_DPI, metadata={"CreationDate": None})
        return buffer.getvalue()
    return to_png(figure, dpi=130 if width == "screen" else _PRINT_DPI)


def fit_width(figure: Figure, width: Literal["column", "page"]) -> None:
    """Resize a figure in place; narrower ones become relatively higher, so panels keep room."""
    share = INCHES[width] / figure.get_figwidth()
    figure.set_size_inches(INCHES[width], figure.get_figheight() * math.sqrt(share))
    if width == "column":
        _fold_legends(figure)
    shrink = _SMALLER[width]
    for text in figure.findobj(Text):
        text.set_fontsize(shrink * float(text.get_fontsize()))
    for axes in figure.axes:
        for line in axes.lines:
            line.set_linewidth(shrink * line.get_linewidth())


def _fold_legends(figure: Figure) -> None:
    """Give legends beside the panels two columns, as four are wider than a column of text."""
    for legend in list(figure.legends):
        size = legend.get_texts()[0].get_fontsize()
        labels = [text.get_text() for text in legend.get_texts()]
        handles = [handle for handle in legend.legend_handles if handle is not None]
        legend.remove()
        figure.legend(
            handles, labels, loc="outside upper right", ncols=2, fontsize=size, frameon=False
        )
