"""Figures of single runs: heights over time, torque in phase space, estimated height."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.evaluate.metrics import ESTIMATED_HEIGHT, START_SECONDS, SWITCH_SECONDS, stretches
from hopping_leg.figure_style import (
    COLOURS,
    COMMAND_COLOUR,
    TORQUE_MAP,
    WIDTH,
    colour,
    panels,
    styled,
)
from hopping_leg.hop_detection import FLIGHT_CLEARANCE, trace_hops
from hopping_leg.trace import Trace


@styled
def draw_heights(traces: Mapping[str, Trace]) -> Figure:
    """Draw one panel per run.

    Args:
        traces: Title of each panel to its run.
    """
    figure, axes = panels(len(traces))
    for index, (title, trace) in enumerate(traces.items()):
        _draw_heights(axes[index][0], trace, colour(index), with_labels=index == 0)
        axes[index][0].set_title(title)
        axes[index][0].set_ylabel("base height / m")
    axes[-1][0].set_xlabel("time / s")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
    return figure


def _draw_heights(axes: Axes, trace: Trace, line: str, *, with_labels: bool) -> None:
    time, command = trace.column("time_s"), trace.column("command_m")
    height, hops = trace.column("height_m"), trace_hops(trace)
    label = (lambda text: text) if with_labels else (lambda _: "_")
    axes.plot(time, height, color=line, linewidth=0.8, alpha=0.8, label=label("base height"))
    axes.step(
        time, command, where="post", color=COMMAND_COLOUR, linewidth=1.4, label=label("command")
    )
    axes.plot(
        time[hops.tick],
        hops.apex,
        ".",
        color="black",
        markersize=3.5,
        label=label("apex in flight"),
    )
    first = True
    for start, end in stretches(command):
        settle = START_SECONDS if start == 0 else SWITCH_SECONDS
        counted = (hops.tick < end) & (time[hops.tick] >= time[start] + settle)
        if counted.any():
            axes.hlines(
                np.median(hops.apex[counted]),
                time[start] + settle,
                time[end - 1],
                color="#D55E00" if line != "#D55E00" else "#0072B2",
                linewidth=1.8,
                zorder=4,
                label=label("median apex") if first else "_",
            )
            first = False
    axes.margins(x=0.01)


SECONDS = 10.0
"""Length of the paper's trial, s."""


@styled
def draw_phase_space(trace: Trace, title: str = "") -> Figure:
    """Draw the torque the controller asked of the knee at every configuration it met.

    Line: one example phase; circle: its start; diamond: its end.

    Args:
        trace: A run at a constant command; 10 s after the start are drawn, or what there is of
            a shorter one.
        title: Title of the figure.
    """
    time = trace.column("time_s")
    chosen = (time >= START_SECONDS) & (time < START_SECONDS + SECONDS)
    if not chosen.any():
        chosen = time < SECONDS
    angle, speed, torque = (
        trace.column(f"knee_{name}")[chosen]
        for name in ("position_rad", "velocity_rad_s", "command_nm")
    )
    flight = trace.column("foot_clearance_m")[chosen] >= FLIGHT_CLEARANCE
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    limit = float(np.nanmax(np.abs(torque), initial=0.0)) or 1.0
    for axes, name, phase in ((panels[0], "flight", flight), (panels[1], "stance", ~flight)):
        dots = axes.scatter(
            angle[phase],
            speed[phase],
            c=torque[phase],
            cmap=TORQUE_MAP,
            vmin=-limit,
            vmax=limit,
            s=9,
            edgecolors="0.6",
            linewidths=0.2,
            rasterized=True,
        )
        _example(axes, angle, speed, phase)
        axes.set_title(name)
        axes.set_xlabel("knee angle / rad")
    panels[0].set_ylabel("knee velocity / (rad/s)")
    figure.colorbar(dots, ax=panels, label="knee torque asked for / N m")
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    return figure


def _example(axes: Axes, angle: Array, speed: Array, phase: BoolArray) -> None:
    """Draw the complete phase of median length."""
    edges = np.flatnonzero(np.diff(phase)) + 1
    spans = [(a, b) for a, b in itertools.pairwise(edges) if phase[a]]
    if not spans:
        return
    start, end = sorted(spans, key=lambda span: span[1] - span[0])[len(spans) // 2]
    axes.plot(angle[start:end], speed[start:end], color="black", linewidth=1.3)
    look: dict[str, Any] = {
        "color": "white",
        "markeredgecolor": "black",
        "markersize": 7,
        "linestyle": "none",
    }
    axes.plot(angle[start], speed[start], marker="o", label="start", **look)
    axes.plot(angle[end - 1], speed[end - 1], marker="D", label="end", **look)
    axes.legend(loc="lower right")


SHOWN_SECONDS = 3.0


@styled
def draw_estimate(trace: Trace, title: str = "") -> Figure:
    """Draw estimate and truth over a few hops, and the error over the whole run.

    Args:
        trace: A run whose controller records ``estimated_height_m``.
        title: Title of the figure.
    """
    time, height, estimate = (trace.column(n) for n in ("time_s", "height_m", ESTIMATED_HEIGHT))
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    over_time, spread = figure.subplots(1, 2, width_ratios=(2, 1))
    shown = (time >= START_SECONDS) & (time < START_SECONDS + SHOWN_SECONDS)
    over_time.plot(time[shown], height[shown], color=COLOURS[0], label="true")
    over_time.plot(time[shown], estimate[shown], "--", color=COLOURS[1], label="estimated")
    over_time.set(xlabel="time / s", ylabel="base height / m")
    over_time.margins(y=0.15)
    over_time.legend(loc="upper right", ncols=2)
    settled = time >= START_SECONDS
    flight = trace.column("foot_clearance_m") > 0
    error = 1e3 * (estimate - height)
    known = settled & np.isfinite(error)
    bins = np.linspace(error[known].min() - 1, error[known].max() + 1, 50)
    for name, phase, paint in (
        ("flight", known & flight, COLOURS[0]),
        ("stance", known & ~flight, COLOURS[1]),
    ):
        spread.hist(error[phase], bins=bins, histtype="step", density=True, color=paint, label=name)
    spread.set(xlabel="estimated - true / mm", ylabel="density / (1/mm)")
    spread.legend()
    over_time.set_title(title)
    return figure
