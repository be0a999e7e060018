"""List policies, show what one says of itself.

Examples:
  hop policies list
  hop policies show fast
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from hopping_leg.cli.options import (
    JsonFile,
    save_json,
    say_written,
    show_table,
)
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.io import write_atomically


@dataclass(frozen=True)
class List:
    """List the policies that come with the package."""

    json: JsonFile = None


@dataclass(frozen=True)
class Show:
    """Show what a policy file says about itself, e.g. `hop policies show fast --out fast.onnx`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    out: Path | None = None
    """Write a copy of the ONNX file here: raw joint measurements in, joint torques (N m) out."""
    json: JsonFile = None


def run(args: List | Show) -> None:
    """List or show policies."""
    if isinstance(args, List):
        _list(args)
    else:
        _show(args)


def _list(args: List) -> None:
    policies = [load_policy(name) for name in shipped_policies()]
    rows = [
        {"policy": p.name, "robot": p.card.robot, "from": p.card.command_low}
        | {"to": p.card.command_high, "recipe": p.card.recipe}
        for p in policies
    ]
    titles = ("policy", "robot", "from, m", "to, m", "recipe")
    show_table(titles, (row.values() for row in rows))
    save_json(args.json, rows)


def _show(args: Show) -> None:
    policy = load_policy(args.policy)
    facts = {**asdict(policy.card), "digest": policy.digest, "inputs": policy.inputs}
    show_table(("entry", "value"), facts.items(), f"policy {policy.name}")
    save_json(args.json, facts)
    if args.out:
        write_atomically(args.out, policy.content)
        say_written(args.out)
