"""Torque of the knee over its phase space, in flight and in stance (Fig. 6)."""

import itertools
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.evaluate.figures.style import TORQUE_MAP, WIDTH, styled
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.trace import Trace

SECONDS = 10.0
"""Length of the paper's trial, s."""


@styled
def draw_phase_space(trace: Trace, title: str = "") -> Figure:
    """Draw the torque the controller asked of the knee at every configuration it met.

    Line: one example phase; circle: its start; diamond: its end.

    Args:
        trace: A run at a constant command; 10 s after the start are drawn, or what there is of
            a shorter one.
        title: Of the figure.
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
