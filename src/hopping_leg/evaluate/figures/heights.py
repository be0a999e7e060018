"""Base height over time with commands, apexes and the median apex of every step (Figs. 5, 8)."""

import itertools
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.evaluate.figures.style import COMMAND_COLOUR, colour, panels, styled
from hopping_leg.evaluate.metrics import START_SECONDS, SWITCH_SECONDS
from hopping_leg.hop_detection import find_hops
from hopping_leg.trace import Trace


@styled
def draw_heights(traces: Mapping[str, Trace]) -> Figure:
    """Draw one panel per run.

    Args:
        traces: Title of each panel to its run.
    """
    figure, axes = panels(len(traces))
    for index, (title, trace) in enumerate(traces.items()):
        _draw(axes[index][0], trace, colour(index), with_labels=index == 0)
        axes[index][0].set_title(title)
        axes[index][0].set_ylabel("base height / m")
    axes[-1][0].set_xlabel("time / s")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
    return figure


def _draw(axes: Axes, trace: Trace, line: str, *, with_labels: bool) -> None:
    time, command = trace.column("time_s"), trace.column("command_m")
    height = trace.column("height_m")
    hops = find_hops(height, trace.column("height_rate_m_s"), trace.column("foot_clearance_m"))
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
    for start, end in _steps(command):
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


def _steps(command: Array) -> list[tuple[int, int]]:
    edges = [0, *(np.flatnonzero(np.diff(command)) + 1).tolist(), len(command)]
    return list(itertools.pairwise(edges))
