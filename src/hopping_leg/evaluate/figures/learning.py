"""How trainings went: the score of every snapshot, over experience and over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.evaluate.figures.style import WIDTH, colour, styled

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
