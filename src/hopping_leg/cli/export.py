"""Write a leg as URDF, a policy as ONNX, or traces as MCAP.

Examples:
  hop export urdf --robot legv2 --out leg.urdf
  hop export policy fast --out fast.onnx
  hop export traces runs/first/traces/*.parquet --out runs/mcap
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from hopping_leg.cli.options import JsonFile, RobotFile, save_json, say_written, show_table
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot, to_urdf


@dataclass(frozen=True)
class Urdf:
    """Write a leg as URDF, e.g. `hop export urdf --robot legv2 --out leg.urdf`."""

    robot: RobotFile = "legv2"
    out: Path | None = None
    """File to write; without it the URDF goes to standard output."""


@dataclass(frozen=True)
class Policy:
    """Show what a policy says of itself and write it, e.g. `hop export policy fast`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    out: Path | None = None
    """Write the ONNX file here: raw joint measurements in, joint torques (N m) out."""
    json: JsonFile = None


@dataclass(frozen=True)
class Traces:
    """Write traces as MCAP for Foxglove, rerun or ROS 2, a file for each."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files of `hop evaluate --out DIR`, `hop deploy` or `hop record`, or the .blackbox
    of a killed run."""
    out: Path | None = None
    """Folder to write to; default: beside the traces."""


def run(args: Urdf | Policy | Traces) -> None:
    """Export a leg, a policy or traces."""
    if isinstance(args, Traces):
        from hopping_leg.flight_recording import load_trace
        from hopping_leg.formats import to_mcap

        for path in args.traces:
            file = (args.out or path.parent) / f"{path.stem}.mcap"
            write_atomically(file, to_mcap(load_trace(path)))
            say_written(file)
    elif isinstance(args, Policy):
        from hopping_leg.controllers.registry import load_policy

        policy = load_policy(args.policy)
        facts = policy.contract() | {"digest": policy.digest}
        show_table(("entry", "value"), facts.items(), f"policy {policy.name}")
        save_json(args.json, facts)
        if args.out:
            policy.save(args.out)
            say_written(args.out, args.out.with_suffix(".json"))
    elif args.out:
        write_atomically(args.out, to_urdf(load_robot(args.robot)).encode())
        say_written(args.out)
    else:
        sys.stdout.write(to_urdf(load_robot(args.robot)))
