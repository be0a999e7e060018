"""The report of an identification: one HTML page that holds everything and needs nothing."""

from collections.abc import Sequence
from itertools import product
from operator import itemgetter

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from hopping_leg.figures import COLOURS, WIDTH, styled
from hopping_leg.html_page import Column, page_template, svg_uri, table
from hopping_leg.identify import result
from hopping_leg.identify.result import Identified
from hopping_leg.identify.validation import RESTART, Overlay, overlays
from hopping_leg.robot import JOINTS

_MOST = 12  # recordings drawn, those that fit worst
_SHOWN = 6.0  # of each, s
_PANELS = {"position": "rad", "torque": "N m"}


def write_fit_report(identified: Identified, command: str = "", threads: int = 0) -> bytes:
    """Return the report as HTML, with the command that made it; threads simulate what is drawn."""
    candidates = (identified.start, identified.hypothesis)
    drawn = overlays(identified.held, candidates, threads)
    known = [(o.simulated["position"][-1], o.measured["position"]) for o in drawn]
    errors = [float(np.nanmean(np.square(found - true))) for found, true in known]
    worst = sorted(sorted(range(len(drawn)), key=errors.__getitem__, reverse=True)[:_MOST])
    rigs = ", ".join(dict.fromkeys(r.metadata.rig for r in (*identified.fit, *identified.held)))
    fit, held = (sum(r.duration for r in part) for part in (identified.fit, identified.held))
    subtitle = (
        f"{result.warning(identified)} {identified.start.robot.name} on {rigs}; {fit:.0f} s fitted,"
        f" {held:.0f} s held out to judge ({identified.split}); search: {identified.plan.search}"
    )
    page = page_template("hopping_leg.identify", "report.html.j2").render(
        title=f"{identified.robot.name} identified",
        subtitle=subtitle.strip(),
        command=command,
        split=identified.split,
        quality=_table(result.ERRORS, result.shown_errors(identified)),
        parameters=_table(result.PARAMETERS, result.shown_parameters(identified)),
        statements=identified.identifiability.statements,
        fits=[_fit(overlay) for overlay in map(drawn.__getitem__, worst)],
        left_out=max(0, len(drawn) - _MOST),
        provenance=result.provenance(identified),
    )
    return page.encode()


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Markup:
    return table([Column(text, itemgetter(n)) for n, text in enumerate(headings)], rows)


def _fit(overlay: Overlay) -> dict[str, str]:
    how = "under its own joint controller, started once"
    if overlay.restarted:
        how = f"driven by the recorded torques, started anew every {RESTART:g} s"
    return {
        "title": overlay.recording.name,
        "caption": f"{overlay.recording.metadata.source}; simulated {how}.",
        "source": svg_uri(draw_overlay(overlay)),
    }


@styled
def draw_overlay(overlay: Overlay) -> Figure:
    """Draw measured and simulated positions and torques of the first seconds."""
    rows = slice(np.searchsorted(overlay.recording.time, overlay.recording.time[0] + _SHOWN))
    time = overlay.recording.time[rows]
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True, squeeze=False)
    for axes, (quantity, joint) in zip(grid.flat, product(_PANELS, (0, 1)), strict=True):
        axes.set_ylabel(f"{JOINTS[joint]} {quantity} / {_PANELS[quantity]}")
        measured = overlay.measured[quantity][rows, joint]
        before, after = overlay.simulated[quantity][:, rows, joint]
        known = ~np.isnan(measured)
        axes.plot(time[known], measured[known], ".", color="0.55", markersize=3.0, label="measured")
        axes.plot(time, before, color=COLOURS[4], linewidth=0.9, label="before")
        axes.plot(time, after, color=COLOURS[0], linewidth=1.1, label="after")
        if known.any():  # what runs away before the fit is outside the picture
            shown = np.concatenate([measured[known], after[np.isfinite(after)]])
            low, high = shown.min(), shown.max()
            room = 0.15 * (high - low) + 1e-6
            axes.set_ylim(low - room, high + 1.6 * room)
        axes.margins(x=0.01)
    grid[0, 0].legend(loc="upper right", ncols=3)
    for axes in grid[-1]:
        axes.set_xlabel("time / s")
    return figure
