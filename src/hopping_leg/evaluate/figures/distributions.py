"""Apexes of all hops for each command, controllers side by side (Fig. 9)."""

from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.evaluate.figures.style import COMMAND_COLOUR, WIDTH, colour, styled
from hopping_leg.evaluate.result import Evaluation

_ENOUGH = 5
"""Hops from which on a shape is drawn around the dots."""


@styled
def draw_distributions(evaluation: Evaluation) -> Figure:
    """Draw every hop as a dot, the distribution around it, its median and the command."""
    controllers = evaluation.controllers
    commands = sorted({row.command_m for row in evaluation.summary})
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    slot = 0.8 / len(controllers)
    rng = np.random.default_rng(0)
    for place, command in enumerate(commands):
        axes.hlines(command, place - 0.45, place + 0.45, color=COMMAND_COLOUR, linewidth=1.2)
    for index, controller in enumerate(controllers):
        apexes = {
            entry["command_m"]: np.array(entry["apexes_m"])
            for entry in evaluation.distributions
            if entry["controller"] == controller
        }
        for place, command in enumerate(commands):
            centre = place - 0.4 + slot * (index + 0.5)
            _draw(axes, apexes.get(command, np.empty(0)), centre, slot, colour(index), rng)
        axes.plot([], [], color=colour(index), linewidth=3, label=controller)
    axes.plot([], [], color=COMMAND_COLOUR, linewidth=1.2, label="command")
    axes.set_xticks(range(len(commands)), [f"{c:.2f}" for c in commands])
    axes.grid(visible=False, axis="x")
    axes.set_xlabel("commanded apex height / m")
    axes.set_ylabel("apex height / m")
    figure.legend(loc="outside upper right", ncols=min(len(controllers) + 1, 4))
    return figure


def _draw(
    axes: Axes, apex: Array, centre: float, slot: float, paint: str, rng: np.random.Generator
) -> None:
    if not len(apex):
        return
    if len(apex) >= _ENOUGH and np.ptp(apex) > 0:
        parts = axes.violinplot([apex], [centre], widths=0.9 * slot, showextrema=False, points=200)
        for body in cast("list[PolyCollection]", parts["bodies"]):
            body.set(facecolor=paint, alpha=0.25, edgecolor="none")
    jitter = rng.uniform(-0.18, 0.18, len(apex)) * slot
    dots, *_ = axes.plot(
        centre + jitter, apex, ".", color=paint, markersize=2.5, alpha=0.6, markeredgecolor="none"
    )
    dots.set_rasterized(True)  # thousands of them; as shapes they make a file of megabytes
    axes.hlines(np.median(apex), centre - 0.42 * slot, centre + 0.42 * slot, color=paint, lw=2.2)
