"""Write the trajectory that a leg is excited with before it is identified.

The file holds the joints' targets. It is checked first: reach, joint range, speed and torque.

Examples:
  hop excite fixed-base --robot legv2 --out fixed-base.parquet
  hop excite moving-base --robot legv2 --out moving-base.parquet
  hop excite fixed-base --amplitudes 0.1 0.075 --periods 1 0.5 --swings 10 --margin 0.005 --no-adapt
  hop excite multisine --centre 0.7 -1.4 --amplitude 0.3 0.4 --out multisine.parquet
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from hopping_leg.identify import excitation as excitations
from hopping_leg.identify.excitation import RATE, Excitation, make_excitation
from hopping_leg.identify.feasibility import HardwareRange, demand
from hopping_leg.identify.paper_excitation import (
    AMPLITUDES,
    DURATION,
    PERIODS,
    SWINGS,
    Bend,
    adapt,
    fixed_base,
    moving_base,
)
from hopping_leg.identify.recording_format import Pair
from hopping_leg.io import write_json
from hopping_leg.robot import Robot, load_robot


@dataclass(frozen=True)
class Common:
    """What every excitation needs."""

    robot: str = "legv2"
    """A shipped name or the path of a .toml file."""
    out: Path = Path("excitation.parquet")
    """Parquet file to write."""
    json: Path | None = None
    """Write what it asks of the joints to this file as JSON."""
    rate: float = RATE
    """Targets per second, Hz."""
    track_velocity: bool = False
    """Let the velocity targets be the positions' derivative, as in the lab's recordings; the paper
    sets them to zero."""
    hip_range: Pair = HardwareRange().hip
    """How far the real hip turns, rad."""
    knee_range: Pair = HardwareRange().knee
    """How far the real knee turns, rad."""


@dataclass(frozen=True)
class Grid:
    """The paper's template."""

    amplitudes: tuple[float, ...] = AMPLITUDES
    """A of the paper, m."""
    periods: tuple[float, ...] = PERIODS
    """T1 of the paper, s."""
    duration: float = DURATION
    """All in all, s."""
    margin: float = 0.0
    """How far the leg stays from straight, m; 0 is the paper's text, 0.005 the lab's recordings."""
    bend: Bend = "backward"
    """Side of the knee; the lab's fixed-base recordings bend forward."""
    every_pair: bool = False
    """Combine every amplitude with every period instead of the first with the first and so on."""
    adapt: bool = True
    """Shrink amplitudes that the leg cannot follow instead of refusing them."""


@dataclass(frozen=True)
class FixedBase(Common, Grid):
    """The paper's fixed-base trajectory: the foot strokes while the leg swings."""

    swings: tuple[float, ...] = SWINGS
    """T2 of the paper, s."""


@dataclass(frozen=True)
class MovingBase(Common, Grid):
    """The paper's moving-base trajectory: vertical strokes on the ground."""


@dataclass(frozen=True)
class Multisine(Common):
    """Harmonics of hip and knee around a posture, base clamped."""

    centre: Pair = (0.7, -1.4)
    """Posture of hip and knee, rad."""
    amplitude: Pair = (0.3, 0.4)
    """Largest excursion of hip and knee, rad."""
    lowest: float = 0.1
    """Lowest frequency and spacing of the others, Hz."""
    highest: float = 4.0
    """Highest frequency, Hz."""
    duration: float = 60.0
    """All in all, s."""


def run(args: FixedBase | MovingBase | Multisine) -> None:
    """Write an excitation."""
    robot = load_robot(args.robot)
    limits = HardwareRange(args.hip_range, args.knee_range)
    template: excitations.Template
    if isinstance(args, Multisine):
        sines = (args.centre, args.amplitude, args.lowest, args.highest, args.duration)
        template = excitations.Multisine(*sines)
    else:
        strokes = moving_base
        if isinstance(args, FixedBase):
            strokes = partial(fixed_base, swings=args.swings)
        template = strokes(
            args.amplitudes,
            args.periods,
            duration=args.duration,
            margin=args.margin,
            bend=args.bend,
            every_pair=args.every_pair,
        )
        if args.adapt:
            template = adapt(template, robot, rate=args.rate, limits=limits)
    excitation = make_excitation(
        template, robot, rate=args.rate, limits=limits, track_velocity=args.track_velocity
    )
    excitation.save(args.out)
    facts = _facts(excitation, robot)
    if args.json:
        write_json(args.json, facts)
    table = Table(
        "", "hip", "knee", title=f"{args.out}: {len(excitation)} targets for {robot.name}"
    )
    for name, (hip, knee) in facts["largest"].items():
        table.add_row(name, f"{hip:.3g}", f"{knee:.3g}")
    console = Console()
    console.print(table)
    console.print(excitation.description.replace("; ", "\n"), highlight=False)


def _facts(excitation: Excitation, robot: Robot) -> dict[str, Any]:
    asked = demand(robot, excitation.rig, excitation.position, excitation.rate)
    largest = {"speed_rad_s": asked.velocity, "torque_nm": asked.torque}
    return {
        "robot": robot.name,
        "rig": excitation.rig,
        "rate_hz": excitation.rate,
        "samples": len(excitation),
        "digest": excitation.digest,
        "description": excitation.description,
        "largest": {
            "lower_rad": asked.position.min(axis=0).tolist(),
            "upper_rad": asked.position.max(axis=0).tolist(),
            **{name: np.abs(values).max(axis=0).tolist() for name, values in largest.items()},
        },
    }
