"""All parts of the benchmark in one run, each kept, and what they say about the project's bars."""

import itertools
import os
from dataclasses import dataclass, fields
from pathlib import Path

from hopping_leg.cli.options import JsonFile, at_least, show_table
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.identify.result import LIBRARIES
from hopping_leg.io import versions
from hopping_leg.robot.parameters import JOINTS
from studies.identification.arm import coverage
from studies.identification.known import FIXED, HOPPING, METHODS, RAIL, paper_size, synthetic
from studies.identification.real import HALVES, real
from studies.identification.study import Study
from studies.shared import Row, host

PARTS = ("synthetic", "coverage", "paper-size", "recordings")
"""What can be measured, in order."""
ARM_SECONDS = 12.0
"""Of each recording of an independent arm."""
PAPER_METHODS = ("least-squares", "two-pass")
"""Searches on recordings of the paper's size."""

_HALF = [f"{HALVES}, dcr1_seg{n}" for n in (0, 2, 4)]
_POSITION, _TORQUE = "closed_loop_position_rms_rad", "closed_loop_torque_rms_nm"
_REAL = (
    ("double", "predicted_0_2_s_rms_rad", "double pendulum, 0.2 s ahead", "mrad", (12.0, 29.0)),
    ("double", "predicted_0_5_s_rms_rad", "double pendulum, 0.5 s ahead", "mrad", (33.0, 95.0)),
    ("leg V2", _POSITION, "leg V2, position", "mrad", (25.0, 3.0)),
    ("leg V2", _TORQUE, "leg V2, torque", "N m", (0.14, 0.4)),
    (_HALF[0], _POSITION, "leg V2, slow halves, position", "mrad", (25.0, 3.0)),
    (_HALF[0], _TORQUE, "leg V2, slow halves, torque", "N m", (0.14, 0.4)),
    (_HALF[1], _POSITION, "leg V2, ringing halves, position", "mrad", (25.0, 3.0)),
    (_HALF[1], _TORQUE, "leg V2, ringing halves, torque", "N m", (0.14, 0.4)),
    (_HALF[2], _POSITION, "leg V2, fast halves, position", "mrad", (25.0, 15.0)),
)
"""Bars of real recordings: beginning of rig and recording, number, in words, unit, hip and knee."""


def bars(result: Row) -> list[Row]:
    """Return a record per bar that was measured: what, the bar, the number, whether it is reached.

    Args:
        result: Of the benchmark, by part.
    """
    found: list[tuple[str, float, str, float | None]] = []
    every = result.get("synthetic", {}).get("rows", [])
    if rows := {row["case"]: row for row in every if row["method"] == METHODS["least-squares"]}:
        fixed, rail, hops = rows[FIXED], rows[RAIL], rows[HOPPING]
        error = fixed["worst_identifiable_error_percent"]
        found += [
            ("known twin, fixed base: identifiable parameters", 0.5, "%", error),
            ("known twin, fixed base: time", 10.0, "s", fixed["wall_s"]),
            ("known twin: unseen swings", 1.0, "mrad", 1e3 * rail["other_swings_rms_rad"]),
            ("known twin: unseen squats", 3.0, "mrad", 1e3 * rail["other_squats_rms_rad"]),
            ("known twin: unseen hops", 10.0, "mrad", 1e3 * hops["other_hops_rms_rad"]),
        ]
    splits = result.get("recordings", {}).get("rows", [])
    for (rig, key, what, unit, pair), joint in itertools.product(_REAL, (0, 1)):
        own = [row for row in splits if f"{row['rig']}, {row['held_out']}".startswith(rig)]
        if known := [row[key][joint] for row in own if row[key][joint] is not None]:
            worst = max(known) * (1e3 if unit == "mrad" else 1.0)
            joints = ("joint 1", "joint 2") if rig == "double" else JOINTS
            name = f"{what}, {joints[joint]}, worst split"
            found.append((name, pair[joint], unit, worst))
    if (arms := result.get("coverage")) is not None:
        share, longest = 100 * arms["share_inside"], arms["fit_longest_s"]
        found.append(("independent arms: 95 % intervals that hold the truth", 90.0, "%", share))
        found.append(("independent arms, 12 s each: longest fit", 10.0, "s", longest))
    for row in result.get("paper_size", {}).get("rows", []):
        what = f"{row['recorded_s']:g} s of recordings: {row['method']}"
        found.append((what, 90.0, "s", 60 * row["wall_minutes"]))
    return [
        {
            "what": what,
            "bar": bar,
            "unit": unit,
            "measured": value,
            "reached": value is not None and (value >= bar if "hold" in what else value <= bar),
        }
        for what, bar, unit, value in found
    ]


@dataclass(frozen=True)
class Identify(Study):
    """Identify known twins, independent arms and real recordings; compare searches.

    Each result is kept; interrupted, the same command goes on with the next.
    """

    parts: tuple[str, ...] = PARTS
    """Of synthetic, coverage, paper-size and recordings."""
    recordings: Path | None = None
    """Folder with real recordings; default: the environment's HOPPING_LEG_RECORDINGS, if set."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print what was to be reached and what was, return every number.

        There is an entry per part, and ``bars``: what was to be reached and what was.
        """
        self._check()
        folder = self.recordings or os.environ.get("HOPPING_LEG_RECORDINGS")
        sizes = {f.name: getattr(self, f.name) for f in fields(Study) if f.name != "out"}
        result: Row = {"study": sizes, "host": host()}
        if "synthetic" in self.parts:
            result["synthetic"] = synthetic(self)
        if "coverage" in self.parts:
            asked = {"arms": self.arms, "seed": self.seed, "threads": self.threads}
            result["coverage"] = self.once("coverage", asked, coverage, ARM_SECONDS)
        if "paper-size" in self.parts:
            rows = []
            for method in (m for m in PAPER_METHODS if m in self.searches):
                asked = self.asked(method, self.paper_seconds)
                rows.append(self.once(f"paper-size-{method}", asked, paper_size, method))
            result["paper_size"] = {"rows": rows}
        if "recordings" in self.parts and folder is not None:
            result["recordings"] = real(self, Path(folder))
        result |= {"bars": bars(result), "versions": versions(*LIBRARIES)}
        show_table(
            ("what", "bar", "measured", "unit", "reached"),
            (
                (row["what"], f"{row['bar']:g}",
                 "-" if row["measured"] is None else f"{row['measured']:.3g}",
                 row["unit"], "yes" if row["reached"] else "no")
                for row in result["bars"]
            ),
        )  # fmt: skip
        return result

    def _check(self) -> None:
        at_least(1, generations=self.generations, threads=self.threads, arms=self.arms)
        at_least(4, population=self.population)
        at_least(16, seconds=int(self.seconds))
        at_least(12, paper_seconds=int(self.paper_seconds))
        for kind, given, known in (
            ("part of the benchmark", self.parts, PARTS),
            ("search", self.searches, tuple(METHODS)),
        ):
            for name in given:
                if name not in known:
                    raise UsageError(unknown_name(kind, name, known))
        if "least-squares" not in self.searches and "synthetic" in self.parts:
            raise UsageError("Known twins are always identified by least squares, too; add it.")
