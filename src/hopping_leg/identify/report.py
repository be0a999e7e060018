"""The report of an identification: one HTML page that holds everything and needs nothing."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from hopping_leg.html_page import Column, page_template, svg_uri, table
from hopping_leg.identify.report_figures import (
    draw_correlations,
    draw_course,
    draw_overlay,
    draw_spectra,
)
from hopping_leg.identify.result import Identified, as_json, parameters_json, quality_json
from hopping_leg.identify.validation import RESTART, Overlay, overlays
from hopping_leg.io import Tree
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.robot.robot_files import load_tree

_CAD, _PAPER = "legv2", "legv2-paper"
_UNITS = {"rad": ("mrad", 1e3), "N m": ("N m", 1.0)}
"""What is shown for an SI unit, and how many of them it is."""
_MOST = 12
"""Recordings drawn, those that fit worst."""


def write_fit_report(identified: Identified, command: str = "", threads: int = 0) -> bytes:
    """Return the report as HTML.

    Args:
        identified: What was found.
        command: Command that made it.
        threads: Worker threads of the simulations to draw, 0 for one per core.
    """
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
        recordings=recording_table(drawn),
        fits=[_fit(overlay) for overlay in _worst(drawn)],
        left_out=max(0, len(drawn) - _MOST),
        spectra=svg_uri(draw_spectra(drawn)),
        course=svg_uri(draw_course(identified.passes)),
        provenance=_provenance(as_json(identified)),
    )
    return page.encode()


def quality_table(identified: Identified) -> Markup:
    """Return errors on held-out data before and after the fit."""
    columns = [Column("rms error", lambda row: f"{row['error']} / {_UNITS[row['unit']][0]}")]
    for when in ("before", "after"):
        columns += [Column(f"{when}: {j}", _scaled(f"{j}_{when}")) for j in JOINTS]
    return table(columns, quality_json(identified))


def parameter_table(identified: Identified) -> Markup:
    """Return every parameter beside its start, CAD and the paper's Table I."""
    references = _references(identified)
    columns = [
        Column("parameter", lambda r: r["name"]),
        Column("unit", lambda r: r["unit"]),
        Column("identified", lambda r: f"{r['value']:.4g}", lambda r: r["at_bound"]),
        Column("95 % interval", _interval, _untold),
        Column(f"start: {identified.start.robot.name}", lambda r: f"{r['start']:.4g}"),
    ]
    columns += [Column(name, _looked_up(values)) for name, values in references.items()]
    columns.append(
        Column("bounds", lambda r: f"{_number(r['bound_low'])} .. {_number(r['bound_high'])}")
    )
    return table(columns, parameters_json(identified))


def recording_table(drawn: list[Overlay]) -> Markup:
    """Return each held-out recording's errors before and after the fit."""
    columns = [
        Column("recording", lambda o: o.recording.name),
        Column("rig", lambda o: o.recording.metadata.rig),
    ]
    for quantity, unit, factor in (("position", "mrad", 1e3), ("torque", "N m", 1.0)):
        for index, when in enumerate(("before", "after")):
            heading = f"{quantity} {when} / {unit}: hip, knee"
            columns.append(Column(heading, _rms_text(quantity, index, factor)))
    return table(columns, drawn)


def _references(identified: Identified) -> dict[str, Mapping[str, float]]:
    """Return what other files say of the same leg, by heading; none for another leg."""
    cad, robot = load_robot(_CAD), identified.start.robot
    same = all(
        getattr(cad, link).length == getattr(robot, link).length for link in ("thigh", "shank")
    )
    if not same:
        return {}
    found: dict[str, Mapping[str, float]] = {}
    if robot.digest != cad.digest:
        start = identified.start
        names = [n for n in identified.identifiability.names if not n.startswith("drive.")]
        own = type(start)(cad)
        found[f"CAD ({_CAD})"] = {name: own.get(name) for name in names}
    return found | {f"paper's Table I ({_PAPER})": _table_one(load_tree(_PAPER))}


def _table_one(tree: Tree, prefix: str = "") -> dict[str, float]:
    found: dict[str, float] = {}
    for key, entry in tree.items():
        if isinstance(entry, dict) and "value" not in entry:
            found |= _table_one(entry, f"{prefix}{key}.")
        elif isinstance(entry, dict) and "Table I" in entry["source"]:
            found[prefix + key] = entry["value"]
    return found


def _worst(drawn: list[Overlay]) -> list[Overlay]:
    def error(overlay: Overlay) -> float:
        values = overlay.errors("position")[-1]
        return float(np.nansum(np.square(values)) / max(1, np.isfinite(values).sum()))

    chosen = sorted(drawn, key=error, reverse=True)[:_MOST]
    return [overlay for overlay in drawn if any(overlay is c for c in chosen)]


def _fit(overlay: Overlay) -> dict[str, str]:
    how = (
        f"driven by the recorded torques, started anew every {RESTART:g} s"
        if overlay.restarted
        else "under its own joint controller, started once"
    )
    return {
        "title": overlay.recording.name,
        "caption": f"{overlay.recording.metadata.source}; simulated {how}.",
        "source": svg_uri(draw_overlay(overlay)),
    }


def _subtitle(identified: Identified) -> str:
    rigs = ", ".join(dict.fromkeys(r.metadata.rig for r in (*identified.fit, *identified.held)))
    seconds = [
        sum(float(r.time[-1] - r.time[0]) for r in p) for p in (identified.fit, identified.held)
    ]
    return (
        f"{identified.start.robot.name} on {rigs}; {seconds[0]:.0f} s fitted, {seconds[1]:.0f} s"
        f" held out to judge ({identified.split}); search: {identified.plan.search}"
    )


def _provenance(tree: dict[str, Any]) -> dict[str, str]:
    rows = {"seed": str(tree["seed"]), "split": tree["split"]}
    rows |= tree["versions"]
    search = dict(tree["search"])
    passes, scales = search.pop("passes"), search.pop("scoring")
    rows |= {k.replace("_", " "): str(v) for k, v in search.items()}
    rows |= {f"scale of errors: {k}": f"{v:g}" for k, v in scales.items() if v is not None}
    for one in passes:
        rows[one["name"]] = f"{one['candidates']} candidates, cost {one['cost']:.6g}"
    for r in tree["recordings"]:
        rows[f"{r['use']}: {r['name']}"] = f"{r['rows']} rows, sha256 {r['sha256'] or 'unknown'}"
    return rows


def _scaled(key: str) -> Callable[[Any], str]:
    return lambda row: _number(_UNITS[row["unit"]][1] * row[key])


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"


def _interval(row: dict[str, Any]) -> str:
    if not np.isfinite(row["interval_high"]):
        return "unknown"
    return f"{row['interval_low']:.4g} .. {row['interval_high']:.4g}"


def _untold(row: dict[str, Any]) -> bool:
    return not row["interval_high"] - row["interval_low"] <= abs(row["value"])


def _looked_up(values: Mapping[str, float]) -> Callable[[Any], str]:
    return lambda row: f"{values[row['name']]:.4g}" if row["name"] in values else "-"


def _rms_text(quantity: str, index: int, factor: float) -> Callable[[Any], str]:
    def text(overlay: Overlay) -> str:
        errors = overlay.errors(quantity)[index]
        counts = np.maximum(np.isfinite(errors).sum(axis=0), 1)
        rms = factor * np.sqrt(np.nansum(np.square(errors), axis=0) / counts)
        known = np.isfinite(errors).any(axis=0)
        return ", ".join(_number(v) if k else "-" for v, k in zip(rms, known, strict=True))

    return text
