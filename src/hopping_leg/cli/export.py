"""Write a leg as URDF for other tools; copy or inspect a policy file.

Examples:
  hop export urdf --robot legv2 --out leg.urdf
  hop export policy fast
  hop export policy fast --out fast.onnx
"""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hopping_leg.controllers.registry import load_policy
from hopping_leg.io import write_atomically, write_json
from hopping_leg.robot import load_robot
from hopping_leg.robot.urdf import to_urdf


@dataclass(frozen=True)
class Urdf:
    """Write a leg as URDF, e.g. `hop export urdf --robot legv2 --out leg.urdf`."""

    robot: str = "legv2"
    """A shipped name or the path of a .toml file."""
    out: Path | None = None
    """File to write; without it the URDF goes to standard output."""


@dataclass(frozen=True)
class Policy:
    """Show what a policy file says about itself, e.g. `hop export policy fast --out fast.onnx`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    out: Path | None = None
    """Write a copy of the ONNX file here: raw joint measurements in, joint torques (N m) out."""
    json: Path | None = None
    """Write what it says about itself to this file as JSON."""


def run(args: Urdf | Policy) -> None:
    """Export a leg or a policy."""
    if isinstance(args, Urdf):
        _export_urdf(args)
    else:
        _export_policy(args)


def _export_urdf(args: Urdf) -> None:
    text = to_urdf(load_robot(args.robot))
    if args.out is None:
        sys.stdout.write(text)
        return
    write_atomically(args.out, text.encode())
    print(f"Wrote {args.out}.")


def _export_policy(args: Policy) -> None:
    policy = load_policy(args.policy)
    facts = {**asdict(policy.card), "digest": policy.digest}
    facts |= {"inputs": policy.inputs}
    table = Table("entry", "value", title=f"policy {policy.name}")
    for name, value in facts.items():
        table.add_row(name, escape(str(value)))
    Console().print(table)
    if args.json:
        write_json(args.json, facts)
    if args.out:
        write_atomically(args.out, policy.content)
        print(f"Wrote {args.out}.")
