"""Figures of results: distributions, ladder, robustness, learning curves."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.evaluate.result import Evaluation, Summary
from hopping_leg.figure_style import COMMAND_COLOUR, WIDTH, colour, styled

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
            _draw_apexes(axes, apexes.get(command, np.empty(0)), centre, slot, colour(index), rng)
        axes.plot([], [], color=colour(index), linewidth=3, label=controller)
    axes.plot([], [], color=COMMAND_COLOUR, linewidth=1.2, label="command")
    axes.set_xticks(range(len(commands)), [f"{c:.2f}" for c in commands])
    axes.grid(visible=False, axis="x")
    axes.set_xlabel("commanded apex height / m")
    axes.set_ylabel("apex height / m")
    figure.legend(loc="outside upper right", ncols=min(len(controllers) + 1, 4))
    return figure


def _draw_apexes(
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


@styled
def draw_ladder(evaluation: Evaluation) -> Figure:
    """Draw median apex and error over the command; bars are one standard deviation over hops."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    apex, error = figure.subplots(1, 2)
    controllers = list(dict.fromkeys(row.controller for row in evaluation.ladder))
    commands = sorted({row.command_m for row in evaluation.ladder})
    apex.plot(commands, commands, color=COMMAND_COLOUR, linewidth=1.2, label="command")
    error.axhline(0, color=COMMAND_COLOUR, linewidth=1.2)
    shift = 0.0012
    for index, name in enumerate(controllers):
        rows = [row for row in evaluation.ladder if row.controller == name]
        at, median, spread = _columns(rows)
        look = {"color": colour(index), "marker": "o", "markersize": 3.5, "linewidth": 1.2}
        apex.plot(at, at + median, label=name, **look)
        aside = at + shift * (index - (len(controllers) - 1) / 2)
        error.errorbar(aside, 1e3 * median, 1e3 * spread, capsize=2, elinewidth=0.9, **look)
    for axes in (apex, error):
        axes.set_xticks(commands[::2], [f"{c:.2f}" for c in commands[::2]])
        axes.set_xlabel("commanded apex height / m")
    apex.set_ylabel("median apex height / m")
    error.set_ylabel("apex - command / mm, median and std")
    apex.legend()
    return figure


def _columns(rows: Sequence[Summary]) -> tuple[Array, Array, Array]:
    table = np.array([(row.command_m, row.median_error_m, row.std_m) for row in rows])
    return table[:, 0], table[:, 1], table[:, 2]


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
            _draw_shares(panel, result, axis, controller, index)
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


def _draw_shares(
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


_AXES = (("steps", 1e-6, "experience / million steps"), ("minutes", 1.0, "time / min"))


@styled
def draw_learning(histories: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw one line per training, its best snapshot as a dot.

    Args:
        histories: Label to the snapshots of a training: ``steps``, ``minutes``, ``score_m``.
    """
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (key, factor, label) in zip(panels, _AXES, strict=True):
        for index, (name, rows) in enumerate(histories.items()):
            if not rows:
                continue
            at = np.array([factor * row[key] for row in rows])
            score = np.array([1e3 * row["score_m"] for row in rows])
            best = int(np.argmin(score))
            axes.plot(at, score, color=colour(index), linewidth=1.2, label=name)
            axes.plot(at[best], score[best], "o", color=colour(index), markersize=5)
        axes.set_xlabel(label)
        axes.set_yscale("log")
    panels[0].set_ylabel("score of the snapshot / mm")
    panels[0].legend()
    return figure
