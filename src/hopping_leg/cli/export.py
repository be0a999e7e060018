"""Write a leg as URDF for other tools; copy or inspect a policy file.

Examples:
  hop export urdf --robot legv2 --out leg.urdf
  hop export policy fast
  hop export policy fast --out fast.onnx
"""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from hopping_leg.cli.options import JsonFile, RobotFile, save_json, say_written, show_table
from hopping_leg.controllers.registry import load_policy
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot, to_urdf


@dataclass(frozen=True)
class Urdf:
    """Write a leg as URDF, e.g. `hop export urdf --robot legv2 --out leg.urdf`."""

    robot: RobotFile = "legv2"
    out: Path | None = None
    """File to write; without it the URDF goes to standard output."""


@dataclass(frozen=True)
class PolicyCommand:
    """Show what a policy file says about itself, e.g. `hop export policy fast --out fast.onnx`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    out: Path | None = None
    """Write a copy of the ONNX file here: raw joint measurements in, joint torques (N m) out."""
    json: JsonFile = None


def run(args: Urdf | Annotated[PolicyCommand, tyro.conf.subcommand(name="policy")]) -> None:
    """Export a leg or a policy."""
    if isinstance(args, PolicyCommand):
        policy = load_policy(args.policy)
        facts = {**asdict(policy.card), "digest": policy.digest, "inputs": policy.inputs}
        show_table(("entry", "value"), facts.items(), f"policy {policy.name}")
        save_json(args.json, facts)
        content = policy.content
    else:
        content = to_urdf(load_robot(args.robot)).encode()
        if args.out is None:
            sys.stdout.write(content.decode())
    if args.out:
        write_atomically(args.out, content)
        say_written(args.out)
