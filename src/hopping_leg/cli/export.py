"""Write a leg as URDF, or traces in the files of other tools.

Examples:
  hop export urdf --robot legv2 --out leg.urdf
  hop export traces runs/first/traces/*.parquet --out runs/mcap
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from hopping_leg.cli.options import RobotFile, say_written
from hopping_leg.deploy.flight_recorder import SUFFIX, recover
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot, to_urdf
from hopping_leg.trace import Trace


@dataclass(frozen=True)
class Urdf:
    """Write a leg as URDF, e.g. `hop export urdf --robot legv2 --out leg.urdf`."""

    robot: RobotFile = "legv2"
    out: Path | None = None
    """File to write; without it the URDF goes to standard output."""


@dataclass(frozen=True)
class Traces:
    """Write traces as MCAP for Foxglove, rerun or ROS 2, a file for each."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files of `hop evaluate --traces DIR`, `hop deploy` or `hop record`, or the .blackbox
    of a killed run."""
    out: Path | None = None
    """Folder to write to; default: beside the traces."""


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
    from hopping_leg.formats.mcap_writer import to_mcap

    for path in args.traces:
        trace = recover(path) if path.suffix == SUFFIX else Trace.load(path)
        file = (args.out or path.parent) / f"{path.stem}.mcap"
        write_atomically(file, to_mcap(trace))
        say_written(file)
