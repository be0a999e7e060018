"""Collect the trials of training runs into one results file for the documentation.

python benchmarks/training_curves.py docs/results/training-paper.json \
        "one-step returns=runs/paper-onestep" "shipped=runs/paper-seed0"
"""

import json
import shlex
import sys
from pathlib import Path
from typing import Any

from hopping_leg.io import write_atomically
from hopping_leg.rl.checkpoint import list_checkpoints


def history(run: Path) -> list[dict[str, Any]]:
    """Return every trial of a run, finished or not."""
    finished = run / "result.json"
    if finished.exists():
        rows: list[dict[str, Any]] = json.loads(finished.read_text(encoding="utf-8"))["history"]
        return rows
    newest = list_checkpoints(run / "checkpoints")[-1] / "state.json"
    unfinished: list[dict[str, Any]] = json.loads(newest.read_text(encoding="utf-8"))["tree"][
        "history"
    ]
    return unfinished


def flat(name: str, run: Path) -> list[dict[str, Any]]:
    """Return one row per trial and run: errors and contacts by command."""
    rows = []
    for row in history(run):
        entry = {"setting": name, "steps": row["steps"], "minutes": row["minutes"]}
        for trial in row["trials"]:
            at = f"{trial['command_m']:.2f}"
            entry[f"median_error_{at}_m"] = trial["median_error_m"]
            entry[f"std_{at}_m"] = trial["std_m"]
        entry["body_contact_ticks"] = sum(t["body_contact_ticks"] for t in row["trials"])
        rows.append(entry)
    return rows


def main(out: str, *runs: str) -> None:
    """Write the file.

    Args:
        out: JSON file.
        runs: Each ``setting=folder``.
    """
    pairs = [run.partition("=") for run in runs]
    curves = [row for name, _, folder in pairs for row in flat(name, Path(folder))]
    last = [flat(name, Path(folder))[-1] for name, _, folder in pairs]
    command = shlex.join(["python", "benchmarks/training_curves.py", out, *runs])
    content = {"command": command, "last": last, "curves": curves}
    write_atomically(Path(out), (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


if __name__ == "__main__":
    main(*sys.argv[1:])
