"""Write a leg as URDF, or traces in the files of other tools.

Examples:
  hop export urdf --robot legv2 --out leg.urdf
  hop export traces runs/first/traces/fast-fixed-0.300-0.parquet --format mcap
  hop export traces runs/first/traces/*.parquet --format rerun --out runs/rerun
  hop export traces runs/first/traces/fast-*.parquet --format lerobot --out runs/dataset
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from hopping_leg.cli.options import RobotFile, say_written
from hopping_leg.deploy.flight_recorder import SUFFIX, recover
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.robot import Robot, load_robot, shipped_robots, to_urdf
from hopping_leg.trace import Trace

_SUFFIXES = {"mcap": ".mcap", "rerun": ".rrd"}


@dataclass(frozen=True)
class Urdf:
    """Write a leg as URDF, e.g. `hop export urdf --robot legv2 --out leg.urdf`."""

    robot: RobotFile = "legv2"
    out: Path | None = None
    """File to write; without it the URDF goes to standard output."""


@dataclass(frozen=True)
class Traces:
    """Write traces for Foxglove, ROS 2 or rerun, or all of them as a dataset of LeRobot."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files of `hop evaluate --traces DIR`, `hop deploy` or `hop record`, or the .blackbox
    of a killed run."""
    format: Literal["mcap", "rerun", "lerobot"]
    """`mcap` and `rerun`: a file for each trace; `lerobot`: a dataset with an episode for each."""
    out: Path | None = None
    """Folder to write to; default: files go beside their traces, a dataset into `dataset`."""


def run(args: Urdf | Traces) -> None:
    """Export a leg or traces."""
    if isinstance(args, Traces):
        _export(args)
    elif args.out:
        write_atomically(args.out, to_urdf(load_robot(args.robot)).encode())
        say_written(args.out)
    else:
        sys.stdout.write(to_urdf(load_robot(args.robot)))


def _export(args: Traces) -> None:
    if not args.traces:
        raise UsageError("No trace was named; record some with `hop evaluate ... --traces DIR`.")
    traces = [recover(p) if p.suffix == SUFFIX else Trace.load(p) for p in args.traces]
    if args.format == "lerobot":
        from hopping_leg.formats.lerobot_writer import write_lerobot

        folder = args.out or Path("dataset")
        write_lerobot(traces, folder)
        say_written(folder)
        return
    for path, trace in zip(args.traces, traces, strict=True):
        file = (args.out or path.parent) / f"{path.stem}{_SUFFIXES[args.format]}"
        if args.format == "mcap":
            from hopping_leg.formats.mcap_writer import to_mcap

            write_atomically(file, to_mcap(trace))
        else:
            from hopping_leg.formats.rerun_writer import write_rerun

            write_rerun(trace, _robot(trace), file)
        say_written(file)


def _robot(trace: Trace) -> Robot | None:
    """Return the shipped robot that a trace is of, none for others."""
    name = str(trace.header.get("robot"))
    robot = load_robot(name) if name in shipped_robots() else None
    return robot if robot and robot.has_digest(str(trace.header.get("robot_digest"))) else None
