"""Set stored runs beside each other on one page: evaluations, trainings or both.

A run is a folder or JSON file that `hop evaluate` wrote (the paper's suite) or the folder of a
finished `hop train`. Evaluations are shown in one table and one set of figures, trainings by their
learning curves. Differing robots and conditions are said.

Examples:
  hop compare runs/first runs/second
  hop compare old=runs/first/evaluation.json new=runs/second --out runs/comparison.html
  hop compare runs/fast-seed0 runs/fast-seed1 --json runs/comparison.json
"""

import shlex
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from hopping_leg.errors import UsageError
from hopping_leg.evaluate.compare import set_beside
from hopping_leg.evaluate.compare_report import write_comparison
from hopping_leg.evaluate.stored import read_runs
from hopping_leg.io import write_atomically, write_json


@dataclass(frozen=True)
class Compare:
    """Which runs, and where the page goes."""

    runs: tyro.conf.Positional[tuple[str, ...]]
    """Folders or JSON files; LABEL=PATH chooses the name in all tables."""
    out: Path = Path("comparison.html")
    """File for the comparison, one self-contained HTML page."""
    json: Path | None = None
    """File for every number."""


def run(args: Compare) -> None:
    """Read the runs, write the page."""
    for path in (args.out, args.json):
        if path and path.is_dir():
            raise UsageError(f"{path} is a folder; name a file.")
    compared = set_beside(read_runs(args.runs))
    command = shlex.join(["hop", "compare", *args.runs, "--out", str(args.out)])
    write_atomically(args.out, write_comparison(compared, command))
    if args.json:
        write_json(args.json, {"command": command, **compared.to_json()})
    console = Console()
    for note in compared.notes:
        console.print(note, highlight=False)
    for path in (args.out, args.json):
        if path:
            console.print(f"Wrote {path}", highlight=False, soft_wrap=True)
