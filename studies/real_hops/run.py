"""Recorded hops beside the same hops simulated, robot by robot, and what would bring them together.

Two numbers of each rig are unknown: how much torque the motors really gave, and what the boom adds
to the inertia, or the rail to the friction. They are searched on a grid; each run is judged with
what fits the other runs best.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.figures import COLOURS, WIDTH, styled, to_svg
from hopping_leg.io import write_atomically
from hopping_leg.robot import GRAVITY, Robot, load_robot
from studies.real_hops.recorded import RIGS, Hop, load_hops
from studies.real_hops.simulated import Simulated, simulate
from studies.shared import show_rows

MEASURED_GAIN = {"boom": 0.91, "rail": 1.0}
"""Measured torque over what ``simulate`` takes for the motors'."""
NAMES = {"boom": ("legv2", "legv2-identified"), "rail": ("legv1",)}
"""Robots."""
GAINS = {"boom": np.arange(0.9, 1.61, 0.1), "rail": np.arange(0.7, 1.31, 0.1)}
EXTRAS = {"boom": (0.0, 0.4), "rail": (0.0, 4.0, 8.0)}
"""Mass that the boom adds, kg, and friction of the rail, N."""
_VARIABLE = "HOPPING_LEG_RECORDINGS"
_WEIGHTS = {"push": 0.01, "flight": 0.03, "apex": 0.02}
"""Errors that count alike, s, s and m."""
_NEVER = 1e4  # of a hop that does not leave the ground


def errors(hop: Hop, found: Simulated) -> dict[str, float]:
    """Return simulated less recorded: duration of push and flight, s, and apex, m.

    Without the base's rise on the boom nobody knows how high the ground was where it landed; on the
    rail, where it is level, the apex is that of a parabola as long as the flight.
    """
    flight = float(hop.time[hop.touchdown] - hop.time[hop.lift_off])
    flown = found.touchdown_s - found.lift_off_s
    apex = float(found.rise.max() - hop.rise.max())
    if hop.rig == "rail":
        apex = GRAVITY / 8 * (flown**2 - flight**2)
    elif not np.isfinite(hop.rise[-1]):
        flight = np.nan
    push = found.lift_off_s - float(hop.time[hop.lift_off])
    return {"push": push, "flight": flown - flight, "apex": apex}


def torque_errors(hop: Hop, found: Simulated) -> Array:
    """Return the torques' rms error over push and flight, hip and knee, N m, (2,)."""
    inside = hop.time <= found.time[-1]
    given = [np.interp(hop.time[inside], found.time, column) for column in found.torque.T]
    missed = np.stack(given, axis=1) - hop.torque[inside]
    return np.asarray(np.sqrt(np.mean(missed**2, axis=0)))


def changed(robot: Robot, rig: str, extra: float) -> tuple[Robot, float]:
    """Return the robot with the rail's friction, and the mass that the boom adds."""
    if rig == "boom":
        return robot, extra
    return replace(robot, rail=replace(robot.rail, friction=extra)), 0.0


def _cost(error: dict[str, float]) -> float:
    """Return what counts of the errors; a hop without lift-off or touchdown counts most."""
    counts = [np.nan_to_num(error[k] / size, nan=0.0) for k, size in _WEIGHTS.items()]
    return float(np.sum(np.square(counts))) + (_NEVER if np.isnan(error["push"]) else 0.0)


def compare(folder: Path, report: Callable[[str], None]) -> tuple[dict[str, Any], list[Any]]:
    """Return every number, and of one hop per rig what a figure shows."""
    rows, hops_of, shown = [], {}, []
    for rig in RIGS:
        hops = load_hops(folder, rig)
        hops_of[rig] = len(hops)
        lines = []
        for name in NAMES[rig]:
            report(f"{rig}: {name}")
            robot = load_robot(name)
            first = EXTRAS[rig][0]
            plain = [_simulate(hop, robot, rig, MEASURED_GAIN[rig], first) for hop in hops]
            rows.append(_row(rig, f"{name}, torques as measured", hops, plain))
            if rig == "boom":
                asked = [_simulate(hop, robot, rig, 1.0, first) for hop in hops]
                rows.append(_row(rig, f"{name}, torques as commanded", hops, asked))
            fitted, chosen = _fitted(hops, robot, rig)
            gain, extra = np.mean(chosen, axis=0)
            rows.append(
                _row(rig, f"{name}, fitted to the other runs", hops, fitted)
                | {"torque_gain": float(gain), "extra": float(extra)}
            )
            lines += [(f"{name}, as measured", plain), (f"{name}, fitted", fitted)]
        shown.append((rig, hops[1], [(label, found[1]) for label, found in lines]))
    return {"rows": rows, "hops": hops_of}, shown


def _simulate(hop: Hop, robot: Robot, rig: str, gain: float, extra: float) -> Simulated:
    leg, added = changed(robot, rig, extra)
    return simulate(hop, leg, gain, added)


def _fitted(
    hops: Sequence[Hop], robot: Robot, rig: str
) -> tuple[list[Simulated], list[tuple[float, float]]]:
    """Return each hop with the gain and extra that suit the other runs' hops best, and these."""
    grid = list(product(GAINS[rig].tolist(), EXTRAS[rig]))
    tried = [[_simulate(hop, robot, rig, *point) for hop in hops] for point in grid]
    costs = np.array(
        [[_cost(errors(h, s)) for h, s in zip(hops, one, strict=True)] for one in tried]
    )
    runs = np.array([hop.run for hop in hops])
    best = [int(costs[:, runs != run].sum(axis=1).argmin()) for run in runs]
    return [tried[b][n] for n, b in enumerate(best)], [grid[b] for b in best]


def _row(rig: str, robot: str, hops: Sequence[Hop], found: Sequence[Simulated]) -> dict[str, Any]:
    """Return means and rms of the errors over hops, as far as something was recorded of them."""
    each = [errors(hop, one) for hop, one in zip(hops, found, strict=True)]
    torques = [torque_errors(hop, one) for hop, one in zip(hops, found, strict=True)]
    row: dict[str, Any] = {"rig": rig, "robot": robot, "hops": len(hops)}
    for name, unit in (("push", "s"), ("flight", "s"), ("apex", "m")):
        values = np.array([one[name] for one in each])
        values = values[np.isfinite(values)]
        known = bool(len(values))
        row[f"{name}_mean_{unit}"] = float(values.mean()) if known else None
        row[f"{name}_rms_{unit}"] = float(np.sqrt(np.mean(values**2))) if known else None
    row["not_landed"] = int(np.sum([np.isnan(one["flight"]) for one in each]))
    row["torque_rms_nm"] = np.sqrt(np.mean(np.square(torques), axis=0)).tolist()
    row["recorded_torque_rms_nm"] = np.sqrt(
        np.mean([np.mean(hop.torque**2, axis=0) for hop in hops], axis=0)
    ).tolist()
    return {**row, "torque_gain": None, "extra": None}


@styled
def figure(shown: Sequence[Any]) -> Figure:
    """Draw of one hop per rig the base's rise or the leg's angles, and the knee's torque."""
    drawn = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    axes = drawn.subplots(2, len(shown), squeeze=False)
    for column, (rig, hop, found) in enumerate(shown):
        upper, lower = axes[0][column], axes[1][column]
        recorded = hop.rise if rig == "boom" else hop.q[:, 1]
        upper.plot(hop.time, recorded, color="0.2", label="recorded")
        lower.plot(hop.time, hop.torque[:, 1], color="0.2")
        for number, (label, one) in enumerate(found):
            values = one.rise if rig == "boom" else one.q[:, 1]
            style = {
                "color": COLOURS[number // 2 % len(COLOURS)],
                "linestyle": ("--", "-")[number % 2],
                "lw": 1,
            }
            upper.plot(one.time, values, label=label, **style)
            lower.plot(one.time, one.torque[:, 1], **style)
        upper.set_title(f"{rig}, {hop.run.split('.')[0]}")
        upper.set_ylabel("base's rise, m" if rig == "boom" else "knee, rad")
        lower.set_ylabel("knee, N m")
        lower.set_xlabel("time since the push began, s")
        upper.legend(fontsize=6)
    return drawn


@dataclass(frozen=True)
class RealHops:
    """Hop in simulation as the lab's legs hopped on boom and rail, and set both side by side."""

    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS."""
    figure: Path | None = None
    """SVG file for a hop of each rig."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print and return every number."""
        folder = self.recordings or os.environ.get(_VARIABLE)
        if not folder:
            raise UsageError(f"Name the folder of recordings with --recordings, or in {_VARIABLE}.")
        result, shown = compare(Path(folder), print)
        columns = ("apex_mean_m", "apex_rms_m", "push_mean_s", "flight_mean_s")
        show_rows(result["rows"], "rig", "robot", *columns)
        if self.figure is not None:
            write_atomically(self.figure, to_svg(figure(shown)))
        return result
