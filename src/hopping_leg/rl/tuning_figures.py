"""A study of `hop tune`: how it went, what mattered, and where the good numbers lie."""

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from hopping_leg.colours import COLOURS
from hopping_leg.figure_style import WIDTH, styled

_COLUMNS = 3


@styled
def draw_history(study: dict[str, Any]) -> Figure:
    """Draw the score of every trial, the best so far, and trials that were given up."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    axes = figure.subplots()
    done, given_up = _done(study), [t for t in study["trials"] if t["state"] == "pruned"]
    numbers, scores = [t["number"] for t in done], [1e3 * t["score_m"] for t in done]
    axes.plot(numbers, scores, "o", color=COLOURS[0], markersize=4, label="finished")
    if scores:
        best = np.minimum.accumulate(scores)
        axes.step(numbers, best, where="post", color=COLOURS[1], label="best so far")
    last = [(t["number"], 1e3 * t["snapshots_m"][-1]) for t in given_up if t["snapshots_m"]]
    if last:
        axes.plot(*zip(*last, strict=True), "x", color="0.6", markersize=4, label="given up")
    axes.set(yscale="log", xlabel="trial", ylabel="score / mm")
    axes.legend()
    return figure


@styled
def draw_importance(study: dict[str, Any]) -> Figure:
    """Draw how much each number matters for the score."""
    shares = dict(sorted(study["importance"].items(), key=lambda entry: entry[1]))
    figure = Figure(figsize=(WIDTH, 0.8 + 0.28 * max(len(shares), 1)), layout="constrained")
    axes = figure.subplots()
    axes.barh(list(shares), list(shares.values()), color=COLOURS[0])
    axes.set_xlabel("share of importance (PED-ANOVA)")
    return figure


@styled
def draw_slices(study: dict[str, Any]) -> Figure:
    """Draw the score of every finished trial over each number."""
    names, done = list(study["space"]), _done(study)
    rows = math.ceil(len(names) / _COLUMNS)
    figure = Figure(figsize=(WIDTH, 2.0 * rows + 0.3), layout="constrained")
    panels = figure.subplots(rows, _COLUMNS, sharey=True, squeeze=False).ravel()
    scores = [1e3 * t["score_m"] for t in done]
    for axes, name in zip(panels, names, strict=False):
        places, labels = _places(study, name, done)
        axes.plot(places, scores, "o", color=COLOURS[0], markersize=3)
        if labels:
            axes.set_xticks(range(len(labels)), labels, fontsize=6, rotation=15)
        elif study["space"][name].get("log"):
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set(xlabel=name, yscale="log")
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    for axes in panels[::_COLUMNS]:
        axes.set_ylabel("score / mm")
    return figure


@styled
def draw_parallel(study: dict[str, Any]) -> Figure:
    """Draw every finished trial as a line over all numbers, the best quarter in colour."""
    names, done = list(study["space"]), _done(study)
    figure = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    axes = figure.subplots()
    columns = []
    for name in names:
        places, labels = _places(study, name, done)
        dimension, values = study["space"][name], np.asarray(places, float)
        low, high = (0.0, len(labels) - 1.0) if labels else (dimension["low"], dimension["high"])
        if not labels and dimension["log"]:
            values, low, high = np.log(values), math.log(low), math.log(high)
        columns.append((values - low) / max(high - low, 1e-12))
    good = len(done) - max(len(done) // 4, 1)
    for rank, index in enumerate(np.argsort([-t["score_m"] for t in done])):
        look = {"color": COLOURS[1], "linewidth": 1.3} if rank >= good else {"color": "0.8"}
        axes.plot(range(len(names)), [column[index] for column in columns], **look)
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_ylabel("place in the range")
    return figure


FIGURES = {
    "history": draw_history,
    "importance": draw_importance,
    "slices": draw_slices,
    "parallel": draw_parallel,
}
"""All of them, by name; each takes what ``hop tune --json`` writes."""


def _done(study: dict[str, Any]) -> list[dict[str, Any]]:
    return [trial for trial in study["trials"] if trial["score_m"] is not None]


def _places(
    study: dict[str, Any], name: str, done: list[dict[str, Any]]
) -> tuple[list[float], list[str]]:
    """Return where trials stand along a number, and the names of its places if it has any."""
    values = [trial["params"][name] for trial in done]
    choices = study["space"][name].get("choices")
    if choices is None:
        return values, []
    labels = ["x".join(map(str, c)) if isinstance(c, list | tuple) else str(c) for c in choices]
    return [labels.index(str(value)) for value in values], labels
