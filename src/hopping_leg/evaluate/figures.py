"""Figures: heights over time, phase space, distributions, ladder, robustness."""

import math
from collections.abc import Mapping
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopping_leg import hop_detection
from hopping_leg.arrays import Array
from hopping_leg.evaluate.metrics import START_SECONDS, SWITCH_SECONDS, stretches
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.figures import COMMAND, TORQUE_MAP, WIDTH, controller_colours, panels, styled
from hopping_leg.trace import Trace

_PHASE_SPACE_SECONDS = 10.0  # of the paper's trial
_TYPICAL = 99.0  # percentile up to which a scale reaches, where single ticks are far outside
_COLUMNS = 4  # panels of robustness beside each other


@styled
def draw_heights(traces: Mapping[str, Trace]) -> Figure:
    """Draw base height, command and apexes over time, a panel per controller."""
    figure, axes = panels(len(traces))
    for (panel,), (name, paint) in zip(axes, controller_colours(traces).items(), strict=True):
        trace = traces[name]
        time, command = trace.column("time_s"), trace.column("command_m")
        height, hops = trace.column("height_m"), hop_detection.trace_hops(trace)
        panel.plot(time, height, color=paint, linewidth=0.8, alpha=0.8, label="base height")
        panel.step(time, command, where="post", color=COMMAND, linewidth=1.4, label="command")
        look: dict[str, Any] = {"color": paint, "markersize": 6, "label": "apex in flight"}
        panel.plot(time[hops.tick], hops.apex, ".", **look)
        look = {"color": "black", "linewidth": 1.6, "zorder": 4, "label": "median apex"}
        for start, end in stretches(command):
            begin = time[start] + (SWITCH_SECONDS if start else START_SECONDS)
            apex = hops.apex[(hops.tick < end) & (time[hops.tick] >= begin)]
            if len(apex):
                panel.hlines(np.median(apex), begin, time[end - 1], **look)
                look["label"] = "_"
        panel.margins(x=0.01)
        panel.set_title(name)
        panel.set_ylabel("base height / m")
    axes[-1][0].set_xlabel("time / s")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
    return figure


@styled
def draw_phase_space(traces: Mapping[str, Trace]) -> Figure:
    """Draw the torque that controllers asked of the knee at every configuration they met.

    A row per controller, all on the same axes and colours. Of a run at a constant command 10 s
    after the start are drawn, or what there is of a shorter one.
    """
    figure, axes = panels(len(traces), 2)
    shown = {name: _phase_space(trace) for name, trace in traces.items()}
    torques = [np.abs(found["knee_command_nm"]) for found in shown.values()]
    ranges = [float(np.nanpercentile(t, _TYPICAL)) for t in torques if np.isfinite(t).any()]
    limit = median(ranges or [0.0]) or 1.0
    look: dict[str, Any] = {"cmap": TORQUE_MAP, "vmin": -limit, "vmax": limit, "s": 9}
    look |= {"edgecolors": "0.6", "linewidths": 0.2, "rasterized": True}
    for row, (name, found) in zip(axes, shown.items(), strict=True):
        angle, speed, torque, clearance = found.values()
        flight = clearance >= hop_detection.FLIGHT_CLEARANCE
        for panel, title, phase in ((row[0], "flight", flight), (row[1], "stance", ~flight)):
            dots = panel.scatter(angle[phase], speed[phase], c=torque[phase], **look)
            panel.set_title(f"{name}, {title}")
        row[0].set_ylabel("knee velocity / (rad/s)")
    for panel in axes[-1]:
        panel.set_xlabel("knee angle / rad")
    figure.colorbar(dots, ax=np.array(axes), label="knee torque / N m", extend="both", aspect=40)
    return figure


def _phase_space(trace: Trace) -> dict[str, Array]:
    """Return what is drawn of a run: angle, velocity, torque, clearance of the foot."""
    time = trace.column("time_s")
    chosen = (time >= START_SECONDS) & (time < START_SECONDS + _PHASE_SPACE_SECONDS)
    if not chosen.any():
        chosen = time < _PHASE_SPACE_SECONDS
    names = ("knee_position_rad", "knee_velocity_rad_s", "knee_command_nm", "foot_clearance_m")
    return {name: trace.column(name)[chosen] for name in names}


@styled
def draw_distributions(evaluation: Evaluation) -> Figure:
    """Draw how the apexes at every command are distributed, their range, median and command."""
    commands = sorted({row.command_m for row in evaluation.summary})
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    at = np.arange(len(commands))
    axes.hlines(commands, at - 0.45, at + 0.45, color=COMMAND, linewidth=1.2, label="command")
    colours = controller_colours(evaluation.controllers)
    slot = 0.8 / len(colours)
    for index, (controller, paint) in enumerate(colours.items()):
        look: dict[str, Any] = {"facecolor": (paint, 0.3), "linecolor": paint, "showmedians": True}
        for found in evaluation.distributions:
            if found["controller"] == controller and found["apexes_m"]:
                centre = commands.index(found["command_m"]) - 0.4 + slot * (index + 0.5)
                axes.violinplot([found["apexes_m"]], [centre], widths=0.9 * slot, **look)
        axes.plot([], [], color=paint, linewidth=3, label=controller)
    axes.set_xticks(at, [f"{c:.2f}" for c in commands])
    axes.grid(visible=False, axis="x")
    axes.set(xlabel="commanded apex height / m", ylabel="apex height / m")
    figure.legend(loc="outside upper right", ncols=4)
    return figure


@styled
def draw_ladder(evaluation: Evaluation) -> Figure:
    """Draw the median error over the command; bars are one standard deviation over hops."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    colours = controller_colours(row.controller for row in evaluation.ladder)
    axes.axhline(0, color=COMMAND, linewidth=1.2)
    for index, (name, paint) in enumerate(colours.items()):
        rows = [row for row in evaluation.ladder if row.controller == name]
        at, error, spread = np.array([(r.command_m, r.median_error_m, r.std_m) for r in rows]).T
        aside = at + 0.0012 * (index - (len(colours) - 1) / 2)
        look: dict[str, Any] = {"color": paint, "marker": "o", "markersize": 3.5, "capsize": 2}
        axes.errorbar(aside, 1e3 * error, 1e3 * spread, label=name, **look)
    axes.set(xlabel="commanded apex height / m", ylabel="apex - command / mm, median and std")
    axes.legend()
    return figure


@styled
def draw_robustness(result: dict[str, Any]) -> Figure:
    """Draw the share of successful trials of a benchmark's JSON over the level, a panel an axis."""
    axes, levels = result["axes"], result["levels"]
    colours = controller_colours(row["controller"] for row in levels)
    rows, columns = math.ceil(len(axes) / _COLUMNS), min(_COLUMNS, len(axes))
    figure = Figure(figsize=(WIDTH, 1.7 * rows + 0.6), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for panel, axis in zip(panels.flat, axes, strict=False):
        for controller, paint in colours.items():
            points = [  # the curve passes through the neutral level, where nothing is changed
                (axis["neutral"] if row["axis"] == "nominal" else row["level"], row["success"])
                for row in levels
                if row["controller"] == controller and row["axis"] in (axis["name"], "nominal")
            ]
            at, shares = np.array(sorted(points)).T
            look: dict[str, Any] = {"color": paint, "marker": "o", "markersize": 3}
            panel.plot(at, 100 * shares, linewidth=1.2, label=controller, **look)
        panel.set_ylim(-5, 105)
        panel.set_title(axis["name"], fontsize=9)
        panel.set_xlabel("level" if axis["unit"] == "1" else f"level / {axis['unit']}")
    for panel in panels.flat[len(axes) :]:
        panel.set_visible(False)
    for line in panels:
        line[0].set_ylabel("successful / %")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=min(len(colours), 4))
    return figure
