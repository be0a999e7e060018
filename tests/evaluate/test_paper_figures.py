import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from hopping_leg.figure_style import INCHES, encode, fit_width


@pytest.fixture
def figure():
    drawn = Figure(figsize=(8, 4), layout="constrained")
    axes = drawn.subplots()
    for name in ("one", "two", "three", "four"):
        axes.plot(np.arange(3), label=name)
    axes.set_xlabel("time / s", fontsize=9)
    drawn.legend(loc="outside upper right", ncols=4)
    return drawn


@pytest.mark.parametrize(("width", "points"), [("column", 7), ("page", 8)])
def test_a_printed_figure_has_its_width_and_readable_text(figure, width, points):
    fit_width(figure, width)
    assert figure.get_figwidth() == INCHES[width]
    assert figure.axes[0].xaxis.label.get_fontsize() == pytest.approx(points)
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["one", "two", "three", "four"]


def test_the_legend_stays_inside_a_column(figure):
    encode(figure, "pdf", "column")
    box = figure.legends[0].get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width


def test_every_format_and_the_same_bytes_twice(figure):
    assert encode(figure, "pdf").startswith(b"%PDF")
    assert encode(figure, "pdf") == encode(figure, "pdf")
    assert b"<svg" in encode(figure, "svg")
    assert encode(figure, "png").startswith(b"\x89PNG")


def test_print_has_300_dots_per_inch(figure):
    import io

    image = plt.imread(io.BytesIO(encode(figure, "png", "column")))
    assert image.shape[1] == round(300 * INCHES["column"])
