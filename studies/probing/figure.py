"""What can be read off a policy's observation and hidden layers."""

import math
from typing import Any

from matplotlib.figure import Figure

from hopping_leg.figure_style import COLOURS, WIDTH, styled

_ACROSS = 2
"""Panels side by side."""


@styled
def draw_probe(result: dict[str, Any]) -> Figure:
    """Draw the scores of all targets, a panel per policy, two side by side.

    Args:
        result: As ``hop bench probe`` writes it.
    """
    rows = result["rows"]
    controllers = list(dict.fromkeys(row["controller"] for row in rows))
    targets = list(dict.fromkeys(row["target"] for row in rows))
    across = min(len(controllers), _ACROSS)
    down = math.ceil(len(controllers) / across)
    height = 0.9 + 0.42 * len(targets) * 1.2
    figure = Figure(figsize=(WIDTH, down * height), layout="constrained")
    grid = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for unused in grid.flat[len(controllers) :]:
        unused.set_visible(False)
    for panel, controller in zip(grid.flat, controllers, strict=False):
        own = [row for row in rows if row["controller"] == controller]
        features = list(dict.fromkeys(row["features"] for row in own))
        step = 0.8 / len(features)
        for k, name in enumerate(features):
            found = [row for row in own if row["features"] == name]
            places = [targets.index(row["target"]) + (k + 0.5) * step - 0.4 for row in found]
            scores = [max(row["score"], 0.0) for row in found]
            errors = [
                [
                    max(score - max(row["low"], 0.0), 0.0)
                    for row, score in zip(found, scores, strict=True)
                ],
                [max(row["high"] - score, 0.0) for row, score in zip(found, scores, strict=True)],
            ]
            plain = name.partition(",")[0]
            colour = COLOURS[[f.partition(",")[0] for f in features].index(plain) % len(COLOURS)]
            panel.errorbar(
                scores,
                places,
                xerr=errors,
                fmt="o" if plain == name else "x",
                markersize=4,
                linewidth=1,
                color=colour,
                label=name,
            )
        panel.set_title(controller)
        panel.set_xlim(-0.02, 1.02)
        panel.set_xlabel("R² or balanced accuracy on other legs")
        panel.tick_params(labelbottom=True)
        panel.legend(loc="best")
    grid[0, 0].set_yticks(range(len(targets)), targets)
    grid[0, 0].set_ylim(len(targets) - 0.5, -0.5)
    return figure
