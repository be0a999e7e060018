"""List policies, show what one says of itself, share them on the Hugging Face hub.

On the hub a policy is a model repository with `policy.onnx` and its card, `README.md`. What is
pulled is checked as any other policy file, and nothing that is too large is downloaded. Pushing
needs a token: `hf auth login`, or the variable HF_TOKEN.

Examples:
  hop policies list
  hop policies list --hub
  hop policies show fast
  hop policies push runs/mine/policy.onnx me/hopping-leg-fast
  hop policies pull me/hopping-leg-fast --out runs/pulled
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from hopping_leg.cli.options import (
    JsonFile,
    save_json,
    say,
    say_next,
    say_written,
    show_table,
)
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.io import write_atomically


@dataclass(frozen=True)
class List:
    """List the policies that come with the package, or those on the hub."""

    hub: bool = False
    """List what others have pushed."""
    json: JsonFile = None


@dataclass(frozen=True)
class Show:
    """Show what a policy file says about itself, e.g. `hop policies show fast --out fast.onnx`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    out: Path | None = None
    """Write a copy of the ONNX file here: raw joint measurements in, joint torques (N m) out."""
    json: JsonFile = None


@dataclass(frozen=True)
class Push:
    """Upload a policy and its card, e.g. `hop policies push runs/mine/policy.onnx me/fast`."""

    policy: tyro.conf.Positional[str]
    """A shipped name or the path of an .onnx file."""
    repository: tyro.conf.Positional[str]
    """OWNER/NAME on the hub; it is made if it does not exist."""
    private: bool = False
    """Make a repository that only you can see."""


@dataclass(frozen=True)
class Pull:
    """Download a policy and its card, e.g. `hop policies pull me/fast --out runs/pulled`."""

    repository: tyro.conf.Positional[str]
    """OWNER/NAME on the hub."""
    revision: str = "main"
    """Branch, tag or commit."""
    out: Path | None = None
    """Folder for `policy.onnx` and `README.md`; default: runs/NAME."""


def run(args: List | Show | Push | Pull) -> None:
    """List, show, push or pull policies."""
    match args:
        case List():
            _list(args)
        case Show():
            _show(args)
        case Push():
            from hopping_leg.controllers import policy_hub

            policy = load_policy(args.policy)
            say(f"Pushed to {policy_hub.push(policy, args.repository, private=args.private)}")
        case Pull():
            _pull(args)


def _list(args: List) -> None:
    if args.hub:
        from hopping_leg.controllers import policy_hub

        rows = policy_hub.search()
        show_table(("repository", "changed"), (row.values() for row in rows))
    else:
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


def _pull(args: Pull) -> None:
    from hopping_leg.controllers import policy_hub

    pulled = policy_hub.pull(args.repository, args.revision)
    folder = args.out or Path("runs") / pulled.policy.name
    files = {policy_hub.POLICY: pulled.policy.content, policy_hub.CARD: pulled.card.encode()}
    for name, content in files.items():
        write_atomically(folder / name, content)
        say_written(folder / name)
    card = pulled.policy.card
    say(
        f"Commit {pulled.commit}, recipe {card.recipe}, robot {card.robot}, commands"
        f" {card.command_low:g} to {card.command_high:g} m."
    )
    say_next(["hop", "evaluate", folder / policy_hub.POLICY])
