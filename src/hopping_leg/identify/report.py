"""The report of an identification: one HTML page that holds everything and needs nothing."""

from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.figures import COLOURS, TORQUE_MAP, WIDTH, styled
from hopping_leg.html_page import Column, page_template, svg_uri, table
from hopping_leg.identify.result import Identified, as_json, parameters_json, quality_json, warning
from hopping_leg.identify.validation import RESTART, Overlay, overlays
from hopping_leg.io import Tree
from hopping_leg.robot import JOINTS, load_robot, load_tree

_PAPER = "legv2-paper"
_UNITS = {"rad": ("mrad", 1e3), "N m": ("N m", 1.0)}
"""What is shown for an SI unit, and how many of them it is."""
_MOST = 12  # recordings drawn, those that fit worst
_SHOWN = 6.0  # longest stretch that is drawn, s
_PANELS = {"position": "rad", "torque": "N m"}


def write_fit_report(identified: Identified, command: str = "", threads: int = 0) -> bytes:
    """Return the report as HTML, with the command that made it; threads simulate what is drawn."""
    candidates = (identified.start, identified.hypothesis)
    drawn = overlays(identified.held, candidates, identified.plan.timestep, threads)
    known = identified.identifiability
    page = page_template("hopping_leg.identify", "report.html.j2").render(
        title=f"{identified.robot.name} identified",
        subtitle=_subtitle(identified),
        command=command,
        split=identified.split,
        quality=quality_table(identified),
        parameters=parameter_table(identified),
        statements=known.statements,
        correlations=svg_uri(draw_correlations(known.names, known.correlation)),
        fits=[_fit(overlay) for overlay in _worst(drawn)],
        left_out=max(0, len(drawn) - _MOST),
        provenance=_provenance(as_json(identified)),
    )
    return page.encode()


def quality_table(identified: Identified) -> Markup:
    """Return errors on held-out data before and after the fit."""
    columns = [Column("rms error", lambda row: f"{row['error']} / {_UNITS[row['unit']][0]}")]
    for when in ("before", "after"):
        columns += [Column(f"{when}: {j}", partial(_scaled, f"{j}_{when}")) for j in JOINTS]
    return table(columns, quality_json(identified))


def parameter_table(identified: Identified) -> Markup:
    """Return every parameter beside its start and, of the paper's leg, the paper's Table I."""
    columns = [
        Column("parameter", lambda r: r["name"]),
        Column("unit", lambda r: r["unit"]),
        Column("identified", lambda r: f"{r['value']:.4g}", lambda r: r["at_bound"]),
        Column("95 % interval", _interval, _untold),
        Column(f"start: {identified.start.robot.name}", lambda r: f"{r['start']:.4g}"),
        Column("bounds", lambda r: f"{_number(r['bound_low'])} .. {_number(r['bound_high'])}"),
    ]
    paper, robot = load_robot(_PAPER), identified.start.robot
    if (paper.thigh.length, paper.shank.length) == (robot.thigh.length, robot.shank.length):
        known = _table_one(load_tree(_PAPER))
        heading = f"paper's Table I ({_PAPER})"
        columns.append(Column(heading, lambda r: _number(known.get(r["name"], np.nan), 4)))
    return table(columns, parameters_json(identified))


def _table_one(tree: Tree, prefix: str = "") -> dict[str, float]:
    found: dict[str, float] = {}
    for key, entry in tree.items():
        if isinstance(entry, dict) and "value" not in entry:
            found |= _table_one(entry, f"{prefix}{key}.")
        elif isinstance(entry, dict) and "Table I" in entry["source"]:
            found[prefix + key] = entry["value"]
    return found


def _worst(drawn: list[Overlay]) -> list[Overlay]:
    """Return the recordings that fit worst, in their order."""
    errors = [float(np.nanmean(np.square(o.errors("position")[-1]))) for o in drawn]
    ranked = sorted(range(len(drawn)), key=lambda index: errors[index], reverse=True)
    return [drawn[index] for index in sorted(ranked[:_MOST])]


def _fit(overlay: Overlay) -> dict[str, str]:
    how = "under its own joint controller, started once"
    if overlay.restarted:
        how = f"driven by the recorded torques, started anew every {RESTART:g} s"
    return {
        "title": overlay.recording.name,
        "caption": f"{overlay.recording.metadata.source}; simulated {how}.",
        "source": svg_uri(draw_overlay(overlay)),
    }


def _subtitle(identified: Identified) -> str:
    rigs = ", ".join(dict.fromkeys(r.metadata.rig for r in (*identified.fit, *identified.held)))
    fit, held = (sum(r.duration for r in part) for part in (identified.fit, identified.held))
    return (
        f"{warning(identified)} {identified.start.robot.name} on {rigs}; {fit:.0f} s fitted,"
        f" {held:.0f} s held out to judge ({identified.split}); search: {identified.plan.search}"
    ).strip()


def _provenance(tree: dict[str, Any]) -> dict[str, str]:
    """Return the facts of an identification's JSON that a person reads."""
    rows = {"seed": str(tree["seed"]), "split": tree["split"], **tree["versions"]}
    for one in tree["search"]["passes"]:
        rows[one["name"]] = f"{one['candidates']} candidates, cost {one['cost']:.6g}"
    for r in tree["recordings"]:
        rows[f"{r['use']}: {r['name']}"] = f"{r['rows']} rows, sha256 {r['sha256'] or 'unknown'}"
    return rows


def _scaled(key: str, row: dict[str, Any]) -> str:
    return _number(_UNITS[row["unit"]][1] * row[key])


@styled
def draw_overlay(overlay: Overlay) -> Figure:
    """Draw measured and simulated positions and torques of the stretch that fits worst."""
    rows = worst_stretch(overlay)
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


def worst_stretch(overlay: Overlay) -> slice:
    """Return the rows of the stretch with the largest position errors after the fit."""
    time = overlay.recording.time
    if time[-1] - time[0] <= _SHOWN:
        return slice(0, len(time))
    error = np.nansum(np.square(overlay.errors("position")[-1]), axis=-1)
    stops = np.searchsorted(time, time + _SHOWN)
    starts = np.flatnonzero(time <= time[-1] - _SHOWN)
    total = np.concatenate([[0.0], np.cumsum(error)])
    first = int(starts[np.argmax(total[stops[starts]] - total[starts])])
    return slice(first, int(stops[first]))


@styled
def draw_correlations(names: Sequence[str], matrix: Array) -> Figure:
    """Draw how the parameters' errors hang together; white is not at all."""
    size = 1.8 + 0.3 * len(names)
    figure = Figure(figsize=(min(WIDTH, size + 1.5), min(WIDTH, size)), layout="constrained")
    axes = figure.subplots()
    shown = axes.imshow(matrix, vmin=-1, vmax=1, cmap=TORQUE_MAP)
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.grid(visible=False)
    figure.colorbar(shown, ax=axes, shrink=0.8, label="correlation")
    return figure


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else "-"


def _interval(row: dict[str, Any]) -> str:
    if not np.isfinite(row["interval_high"]):
        return "unknown"
    return f"{row['interval_low']:.4g} .. {row['interval_high']:.4g}"


def _untold(row: dict[str, Any]) -> bool:
    size = max(abs(row["value"]), row["scale"])
    return not row["interval_high"] - row["interval_low"] <= size
