"""Recorded hops beside the same hops simulated, robot by robot.

The identified leg is judged on a run with what all other recordings tell (``LEFT_OUT``); on a run
that the fit has never had, with the shipped robot. The interval of a predicted apex is made of the
fits that leave one recording out each and of the errors of the other runs' hops.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.cli.options import JsonFile
from hopping_leg.evaluate import statistics
from hopping_leg.figures import COLOURS, WIDTH, encode, styled
from hopping_leg.io import replace_at, write_atomically
from hopping_leg.robot import Robot, load_robot
from studies.real_hops.recorded import RIGS, Hop, load_hops
from studies.real_hops.simulated import Simulated, fall_apex, simulate
from studies.shared import ROOT, Row, recordings_folder, show_rows

LEFT_OUT = ROOT / "studies/identification/results/real_leg.json"
"""What ``python -m studies.identification.real_leg`` found without each recording."""
IDENTIFIED = "legv2-identified"
ROBOTS = {"legv2": "CAD", "legv2-paper": "Table I", IDENTIFIED: "identified", "legv1": "CAD"}
"""What each robot is; ``legv1`` is the rail's."""
DRIVES = {"measured": "torques as measured", "law": "the logged law"}
PAPER_MM = "40 to 60"
"""Mean error of the paper's policy on the real leg, mm."""
_SETTLED = 0.04  # s after lift-off from which on the base flies freely
_LEAST_RUNS = 3


def errors(hop: Hop, found: Simulated) -> dict[str, float]:
    """Return simulated less recorded: push and flight, s, lift-off speed, m/s, and apex, m.

    The speed is that of the parabola from 40 ms after lift-off on. On the rail nobody measured a
    height: there the apex is that of a parabola as long as the flight.
    """
    lift, flight = float(hop.time[hop.lift_off]), float(hop.time[-1] - hop.time[hop.lift_off])
    flown = found.touchdown_s - found.lift_off_s
    error = {"push": found.lift_off_s - lift, "flight": flown - flight, "speed": np.nan}
    if not hop.boom.radius:
        return error | {"apex": fall_apex(flown) - fall_apex(flight)}
    if not np.isfinite(hop.rise).all():
        return error | {"flight": np.nan, "apex": np.nan}
    speeds = [_speed(*course, lift) for course in ((found.time, found.rise), (hop.time, hop.rise))]
    apex = float(found.rise.max() - hop.rise.max())
    return error | {"speed": speeds[0] - speeds[1], "apex": apex}


def _speed(time: Array, rise: Array, lift: float) -> float:
    """Return the base's speed when it has left the ground, m/s."""
    rows = (time >= lift + _SETTLED) & (time <= time[int(np.argmax(rise))] + _SETTLED)
    if np.count_nonzero(rows) < 4:
        return float("nan")
    return float(np.polyval(np.polyder(np.polyfit(time[rows], rise[rows], 2)), lift + _SETTLED))


def torque_errors(hop: Hop, found: Simulated) -> Array:
    """Return the torques' rms error over push and flight, hip and knee, N m, (2,)."""
    inside = hop.time <= found.time[-1]
    given = [np.interp(hop.time[inside], found.time, column) for column in found.torque.T]
    missed = np.stack(given, axis=1) - hop.torque[inside]
    return np.asarray(np.sqrt(np.mean(missed**2, axis=0)))


def known(file: Path = LEFT_OUT) -> tuple[Mapping[str, float], Mapping[str, Mapping[str, float]]]:
    """Return what the boom is beyond its masses, and all numbers of fits without each recording."""
    if not file.is_file():
        return {}, {}
    stored = json.loads(file.read_text(encoding="utf-8"))
    boom = {p["name"]: p["value"] for p in stored["parameters"] if p["name"].startswith("boom.")}
    return boom, {row["recording"]: row["values"] for row in stored["without"]}


def _with(robot: Robot, values: Mapping[str, float]) -> Robot:
    for path, value in values.items():
        robot = replace_at(robot, path, value)
    return robot


def compare(folder: Path) -> tuple[Row, list[Any]]:
    """Return every number, and of one hop per rig what a figure shows."""
    rows, counts, shown = [], {}, []
    boom, others = known()
    for rig, how in RIGS.items():
        hops = load_hops(folder, rig)
        counts[rig], drawn = len(hops), []
        names = [name for name in ROBOTS if name.startswith(how.robot)]
        for name in names:
            robot = _with(load_robot(name), boom if how.robot == "legv2" else {})
            legs = [_with(robot, others.get(h.run, {}) if name == IDENTIFIED else {}) for h in hops]
            for drive in DRIVES if how.robot == "legv2" else ("measured",):
                print(f"{rig}: {name}, {DRIVES[drive]}")
                by_law = drive == "law"
                found = simulate(hops, legs, by_law=by_law)
                row = {"rig": rig, "robot": name, "model": ROBOTS[name], "drive": DRIVES[drive]}
                row |= _row(hops, found)
                if name == IDENTIFIED:
                    spread = [
                        simulate(hops, [_with(robot, values)] * len(hops), by_law=by_law)
                        for values in others.values()
                    ]
                    row |= _coverage(hops, found, spread)
                rows.append(row)
                drawn.append((f"{ROBOTS[name]}, {DRIVES[drive]}", found))
        shown.append((rig, hops, drawn))
    return {"rows": rows, "hops": counts, "paper_error_mm": PAPER_MM}, shown


def _row(hops: Sequence[Hop], found: Sequence[Simulated]) -> Row:
    """Return means and rms of the errors with intervals over runs, hops that failed among them."""
    each = [errors(hop, one) for hop, one in zip(hops, found, strict=True)]
    torques = [torque_errors(hop, one) for hop, one in zip(hops, found, strict=True)]
    row: Row = {"hops": len(hops), "inside_90": None, "half_width_m": None}
    runs = [hop.run for hop in hops]
    for name, unit in (("push", "s"), ("flight", "s"), ("speed", "m_s"), ("apex", "m")):
        values, of = np.array([e[name] for e in each]), np.array(runs)
        known = [v[np.isfinite(v)] for v in (values[of == run] for run in dict.fromkeys(runs))]
        known = [run for run in known if len(run)]
        value, ends = np.full(2, np.nan), np.full((2, 2), np.nan)
        if known:
            value, ends = _moments(known), statistics.bootstrap(known, _moments, 0, _LEAST_RUNS)
        for how, number, interval in zip(("mean", "rms"), value, ends.T, strict=True):
            row[f"{name}_{how}_{unit}"] = float(number)
            row[f"{name}_{how}_{unit}_interval"] = interval.tolist()
    row["not_landed"] = int(np.sum([np.isnan(one.touchdown_s) for one in found]))
    row["torque_rms_nm"] = np.sqrt(np.mean(np.square(torques), axis=0)).tolist()
    return row


def _moments(runs: Sequence[Array]) -> Array:
    every = np.concatenate(list(runs))
    return np.array([np.mean(every), np.sqrt(np.mean(np.square(every)))])


def _coverage(
    hops: Sequence[Hop], found: Sequence[Simulated], spread: Sequence[Sequence[Simulated]]
) -> Row:
    """Return the share of apexes within their predicted 90 % intervals, and the mean half width.

    An interval is that of all fits' predictions, each with the errors of hops of other runs.
    """
    error = np.array([errors(h, s)["apex"] for h, s in zip(hops, found, strict=True)])
    runs = np.array([hop.run for hop in hops])
    inside, halves = [], []
    for k in np.flatnonzero(np.isfinite(error)).tolist():
        scatter = error[(runs != runs[k]) & np.isfinite(error)]
        centres = [one[k].rise.max() for one in spread] or [found[k].rise.max()]
        possible = np.subtract.outer(centres, scatter).ravel()
        low, high = np.quantile(possible, (0.05, 0.95))
        inside.append(low <= hops[k].rise.max() <= high)
        halves.append((high - low) / 2)
    return {"inside_90": float(np.mean(inside)), "half_width_m": float(np.mean(halves))}


@styled
def figure(shown: Sequence[Any]) -> Figure:
    """Draw simulated over recorded apexes on the booms, pushed as measured and by the law."""
    drawn = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    booms = [(rig, hops, found) for rig, hops, found in shown if hops[0].boom.radius]
    axes = drawn.subplots(1, len(DRIVES), sharey=True)
    for ax, drive in zip(axes, DRIVES.values(), strict=True):
        for marker, (rig, hops, found) in zip("os", booms, strict=True):
            real = np.array([hop.rise.max() for hop in hops])
            pairs = [(label.split(",")[0], one) for label, one in found if label.endswith(drive)]
            for colour, (label, one) in zip(COLOURS[1::-1], (pairs[0], pairs[-1]), strict=True):
                rise = [s.rise.max() for s in one]
                ax.plot(1e3 * real, 1e3 * np.array(rise), marker, ms=4, mfc="none", color=colour,
                        label=f"{label}, {rig}")  # fmt: skip
        ends = [100, 500]
        ax.plot(ends, ends, color="0.5", lw=1)
        ax.set_title(drive)
        ax.set_xlabel("recorded apex above the push, mm")
    axes[0].set_ylabel("simulated, mm")
    axes[0].legend(fontsize=7)
    return drawn


@dataclass(frozen=True)
class RealHops:
    """Hop in simulation as the lab's legs hopped on booms and rail, and set both side by side."""

    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS."""
    figure: Path | None = None
    """SVG file for simulated over recorded apexes."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print and return every number."""
        result, shown = compare(recordings_folder(self.recordings))
        columns = ("apex_mean_m", "apex_rms_m", "speed_mean_m_s", "push_mean_s", "flight_mean_s")
        show_rows(result["rows"], "rig", "robot", "drive", *columns)
        if self.figure is not None:
            write_atomically(self.figure, encode(figure(shown), "svg"))
        return result
