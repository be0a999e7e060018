"""Figures for print: the width of a paper's column or page, text that stays readable there."""

import io
import math
from typing import Literal

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.text import Text

from hopping_leg.evaluate.figures.style import to_png, to_svg

Format = Literal["svg", "pdf", "png"]
Width = Literal["screen", "column", "page"]

INCHES = {"column": 3.5, "page": 7.16}
"""Width of a column and of the page in IEEE's two-column format."""

_SMALLER = {"column": 7 / 9, "page": 8 / 9}
"""Text and lines relative to the screen's, whose text is 9 pt."""

_PRINT_DPI = 300


def encode(figure: Figure, kind: Format, width: Width = "screen") -> bytes:
    """Return a figure as a file's content, the same bytes every time.

    Args:
        figure: Is resized if ``width`` is not ``screen``.
        kind: Of file; fonts are embedded in a PDF.
        width: What it shall fill.
    """
    if width != "screen":
        fit_width(figure, width)
    if kind == "svg":
        return to_svg(figure)
    if kind == "pdf":
        return _to_pdf(figure)
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


def _to_pdf(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    with mpl.rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format="pdf", dpi=_PRINT_DPI, metadata={"CreationDate": None})
    return buffer.getvalue()
