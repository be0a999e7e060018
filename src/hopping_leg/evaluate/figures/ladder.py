"""How a controller follows commands between and beyond the trained ones."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.evaluate.figures.style import COMMAND_COLOUR, WIDTH, colour, styled
from hopping_leg.evaluate.result import Evaluation, Summary


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
