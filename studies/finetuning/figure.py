"""How hops came true over the minutes of robot time while a training was continued."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopping_leg.figure_style import WIDTH, colour, styled

_TOP = 0.97
"""Where crosses are drawn, of the panel's height; those of later methods a little lower."""


@styled
def draw_finetuning(result: dict[str, Any]) -> Figure:
    """Draw the true error of every check, one panel per twin, one colour per method.

    Args:
        result: JSON values of ``hop bench finetune``; estimated errors are drawn as dots, checks
            that were ended early, which have no error, as crosses at the top.
    """
    curves = [row for row in result["curves"] if row["kind"] == "check"]
    twins = list(dict.fromkeys(row["twin"] for row in curves))
    methods = list(dict.fromkeys(row["method"] for row in curves))
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    panels = figure.subplots(1, len(twins), sharey=True, squeeze=False)[0]
    for panel, twin in zip(panels, twins, strict=True):
        for index, method in enumerate(methods):
            mine = [r for r in curves if (r["twin"], r["method"]) == (twin, method)]
            _draw(panel, mine, method, index)
        panel.set_title(twin)
        panel.set_xlabel("robot time / min")
        panel.margins(y=0.12)
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("median |apex − command| / mm")
    panels[0].legend()
    return figure


def _draw(panel: Axes, rows: list[dict[str, Any]], method: str, index: int) -> None:
    """Draw a line per seed, a dot per estimate and a cross per check that was ended early."""
    for number, seed in enumerate(dict.fromkeys(row["seed"] for row in rows)):
        mine = [row for row in rows if row["seed"] == seed]
        whole = [row for row in mine if not row["ended_early"]]
        minutes = [row["minutes"] for row in whole]
        panel.plot(
            minutes,
            [1e3 * row["true_error_m"] for row in whole],
            color=colour(index),
            linewidth=1.2,
            label=method if number == 0 else None,
        )
        panel.plot(
            minutes,
            [1e3 * row["error_m"] for row in whole],
            ".",
            color=colour(index),
            markersize=4,
        )
        ended = [row["minutes"] for row in mine if row["ended_early"]]
        panel.plot(
            ended,
            [_TOP - 0.03 * index] * len(ended),
            "x",
            color=colour(index),
            markersize=4,
            transform=panel.get_xaxis_transform(),
        )
