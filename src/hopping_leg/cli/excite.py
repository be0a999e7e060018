"""Write the trajectory that a leg is excited with before it is identified.

The file holds the joints' targets. It is checked first: reach, joint range, speed and torque.

Examples:
  hop excite fixed-base --robot legv2 --out fixed-base.parquet
  hop excite moving-base --robot legv2 --out moving-base.parquet
  hop excite fixed-base --amplitudes 0.1 0.075 --periods 1 0.5 --swings 10 --margin 0.005 --no-adapt
  hop excite optimal --duration 15 --out air.parquet
  hop excite optimal --rig rail --robot my_leg.toml --out ground.parquet
  hop excite multisine --centre 0.7 -1.4 --amplitude 0.3 0.4 --out multisine.parquet
"""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from hopping_leg.cli.options import (
    JsonFile,
    RobotFile,
    at_least,
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
from hopping_leg.identify.optimal_excitation import Design, optimal_excitation
from hopping_leg.progress import ShareProgress
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


@dataclass(frozen=True)
class Optimal(Common):
    """The trajectory that tells most of the leg in its time, by what a fit of it would know.

    It keeps from the ends of the joints' ranges and takes at most 80 % of what the motors give.
    """

    rig: Literal["fixed-base", "rail"] = "fixed-base"
    """Base clamped in the air, or on the rail on the ground, after the leg was recorded in the
    air."""
    duration: float = 15.0
    """Duration of the trajectory, s."""
    generations: int = 80
    """Generations of the search; each takes some seconds."""
    seed: int = 0
    """Seed of the search."""


def run(
    args: FixedBase
    | MovingBase
    | Optimal
    | Annotated[MultisineCommand, tyro.conf.subcommand(name="multisine")],
) -> None:
    """Write an excitation."""
    robot = load_robot(args.robot)
    limits = HardwareRange(args.hip_range, args.knee_range)
    tracked = args.track_velocity
    template, expected = (
        _optimal(args, robot, limits)
        if isinstance(args, Optimal)
        else (_template(args, robot, limits), {})
    )
    excitation = make_excitation(
        template, robot, rate=args.rate, limits=limits, track_velocity=tracked
    )
    excitation.save(args.out)
    facts = _facts(excitation, robot) | expected
    show_table(
        ("", "hip", "knee"),
        [(name, *(f"{x:.3g}" for x in pair)) for name, pair in facts["largest"].items()],
        f"{args.out}: {len(excitation)} targets for {robot.name}",
    )
    say(*excitation.description.split("; "))
    if expected:
        rows = [(r["name"], f"{r['error']:.2g}", r["unit"]) for r in expected["expected"]]
        show_table(("parameter", "expected error", "unit"), rows)
    save_json(args.json, facts)
    say_next(["hop", "record", args.out, "--robot", args.robot])


def _optimal(args: Optimal, robot: Robot, limits: HardwareRange) -> tuple[Template, dict[str, Any]]:
    """Return the best trajectory, and how far off a fit to its recording is expected to be."""
    at_least(1, generations=args.generations)
    at_least(0, seed=args.seed)
    design = Design(
        robot, args.rig, args.duration, args.rate, limits, track_velocity=args.track_velocity
    )
    with ShareProgress() as bar:
        harmonics, expected = optimal_excitation(
            design,
            generations=args.generations,
            seed=args.seed,
            report=lambda share, _: bar.show("searching", share),
        )
    rows = [{"name": p.name, "unit": p.unit, "error": e} for p, e in expected.items()]
    return harmonics, {"expected": rows}


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
