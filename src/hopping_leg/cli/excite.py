"""Write the trajectory that a leg is excited with before it is identified.

The file holds the joints' targets. It is checked first: reach, joint range, speed and torque.

Examples:
  hop excite fixed-base --robot legv2 --out fixed-base.parquet
  hop excite moving-base --robot legv2 --out moving-base.parquet
  hop excite fixed-base --amplitudes 0.1 0.075 --periods 1 0.5 --swings 10 --margin 0.005 --no-adapt
  hop excite multisine --centre 0.7 -1.4 --amplitude 0.3 0.4 --out multisine.parquet
"""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from hopping_leg.cli.options import (
    JsonFile,
    RobotFile,
    save_json,
    say,
    say_next,
    show_table,
)
from hopping_leg.identify import paper_excitation as paper
from hopping_leg.identify import recording_format
from hopping_leg.identify.excitation import (
    RATE,
    Excitation,
    HardwareRange,
    Multisine,
    Template,
    demand,
    make_excitation,
)
from hopping_leg.robot import Robot, load_robot


@dataclass(frozen=True)
class Common:
    """What every excitation needs."""

    robot: RobotFile = "legv2"
    out: Path = Path("excitation.parquet")
    """Parquet file to write."""
    json: JsonFile = None
    rate: float = RATE
    """Targets per second, Hz."""
    track_velocity: bool = False
    """Velocity targets are the positions' derivative, as in the lab's recordings, not zero."""
    hip_range: recording_format.Pair = HardwareRange().hip
    """Range of the real hip, rad."""
    knee_range: recording_format.Pair = HardwareRange().knee
    """Range of the real knee, rad."""


@dataclass(frozen=True)
class MovingBase(Common):
    """The paper's moving-base trajectory: vertical strokes on the ground."""

    amplitudes: tuple[float, ...] = paper.AMPLITUDES
    """Amplitudes of the strokes, the paper's A, m."""
    periods: tuple[float, ...] = paper.PERIODS
    """Periods of the strokes, the paper's T1, s."""
    duration: float = paper.DURATION
    """Duration of all strokes together, s."""
    margin: float = 0.0
    """How far the leg stays from straight, m; 0 is the paper's text, 0.005 the lab's recordings."""
    bend: paper.Bend = "backward"
    """Side of the knee; the lab's fixed-base recordings bend forward."""
    every_pair: bool = False
    """Combine every amplitude with every period instead of the first with the first and so on."""
    adapt: bool = True
    """Shrink amplitudes that the leg cannot follow instead of refusing them."""


@dataclass(frozen=True)
class FixedBase(MovingBase):
    """The paper's fixed-base trajectory: the foot strokes while the leg swings."""

    swings: tuple[float, ...] = paper.SWINGS
    """Periods of the swinging leg, the paper's T2, s."""


@dataclass(frozen=True)
class MultisineCommand(Common):
    """Harmonics of hip and knee around a posture, base clamped."""

    signal: Annotated[Multisine, tyro.conf.arg(name="")] = field(default_factory=Multisine)


def run(
    args: FixedBase
    | MovingBase
    | Annotated[MultisineCommand, tyro.conf.subcommand(name="multisine")],
) -> None:
    """Write an excitation."""
    robot = load_robot(args.robot)
    limits = HardwareRange(args.hip_range, args.knee_range)
    excitation = make_excitation(
        _template(args, robot, limits),
        robot,
        rate=args.rate,
        limits=limits,
        track_velocity=args.track_velocity,
    )
    excitation.save(args.out)
    facts = _facts(excitation, robot)
    show_table(
        ("", "hip", "knee"),
        [(name, *(f"{x:.3g}" for x in pair)) for name, pair in facts["largest"].items()],
        f"{args.out}: {len(excitation)} targets for {robot.name}",
    )
    say(*excitation.description.split("; "))
    save_json(args.json, facts)
    say_next(["hop", "record", args.out, "--robot", args.robot])


def _template(args: MovingBase | MultisineCommand, robot: Robot, limits: HardwareRange) -> Template:
    if isinstance(args, MultisineCommand):
        return args.signal
    make = paper.moving_base
    if isinstance(args, FixedBase):
        make = partial(paper.fixed_base, swings=args.swings)
    strokes = make(
        args.amplitudes,
        args.periods,
        duration=args.duration,
        margin=args.margin,
        bend=args.bend,
        every_pair=args.every_pair,
    )
    return paper.adapt(strokes, robot, rate=args.rate, limits=limits) if args.adapt else strokes


def _facts(excitation: Excitation, robot: Robot) -> dict[str, Any]:
    asked = demand(robot, excitation.rig, excitation.position, excitation.rate)
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
            "speed_rad_s": np.abs(asked.velocity).max(axis=0).tolist(),
            "torque_nm": np.abs(asked.torque).max(axis=0).tolist(),
        },
    }
