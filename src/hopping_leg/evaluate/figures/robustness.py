"""How controllers fail along every axis of the robustness benchmark."""

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopping_leg.evaluate.figures.style import WIDTH, colour, styled

_COLUMNS = 4


@styled
def draw_robustness(result: dict[str, Any]) -> Figure:
    """Draw the share of successful trials over the level, one panel per axis.

    Args:
        result: The benchmark's JSON values.
    """
    axes, controllers = (
        result["axes"],
        list(dict.fromkeys(r["controller"] for r in result["levels"])),
    )
    rows = math.ceil(len(axes) / _COLUMNS)
    columns = min(_COLUMNS, len(axes))
    figure = Figure(figsize=(WIDTH, 1.7 * rows + 0.6), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for panel, axis in zip(panels.flat, axes, strict=False):
        for index, controller in enumerate(controllers):
            _draw(panel, result, axis, controller, index)
        unit = "" if axis["unit"] == "1" else f" / {axis['unit']}"
        panel.set_title(axis["name"], fontsize=9)
        panel.set_xlabel(f"level{unit}")
    for panel in panels.flat[len(axes) :]:
        panel.set_visible(False)
    for line in panels:
        line[0].set_ylabel("successful / %")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=min(len(controllers), 4))
    return figure


def _draw(
    panel: Axes, result: dict[str, Any], axis: dict[str, Any], controller: str, index: int
) -> None:
    """Draw one controller's curve through its neutral level, where nothing is changed."""
    points = [
        (axis["neutral"] if row["axis"] == "nominal" else row["level"], 100 * row["success"])
        for row in result["levels"]
        if row["controller"] == controller and row["axis"] in (axis["name"], "nominal")
    ]
    levels, shares = zip(*sorted(points), strict=True)
    panel.plot(
        levels,
        shares,
        label=controller,
        color=colour(index),
        marker="o",
        markersize=3,
        linewidth=1.2,
    )
    panel.set_ylim(-5, 105)
