"""Collects the trials of training runs: errors and contacts by command, over the steps."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from hopping_leg.errors import UsageError
from hopping_leg.rl.checkpoint import list_checkpoints


@dataclass(frozen=True)
class Curves:
    """Collect the trials of training runs, finished or not."""

    runs: tyro.conf.Positional[tuple[str, ...]]
    """Folders of runs, each as SETTING=FOLDER."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Return one row per trial, and the last of each run."""
        by_setting = [_rows(run) for run in self.runs]
        return {
            "last": [rows[-1] for rows in by_setting],
            "curves": [row for rows in by_setting for row in rows],
        }


def _rows(run: str) -> list[dict[str, Any]]:
    name, _, folder = run.partition("=")
    rows = []
    for row in _history(Path(folder)):
        entry = {"setting": name, "steps": row["steps"], "minutes": row["minutes"]}
        for trial in row["trials"]:
            at = f"{trial['command_m']:.2f}"
            entry[f"median_error_{at}_m"] = trial["median_error_m"]
            entry[f"std_{at}_m"] = trial["std_m"]
        entry["body_contact_ticks"] = sum(t["body_contact_ticks"] for t in row["trials"])
        rows.append(entry)
    return rows


def _history(run: Path) -> list[dict[str, Any]]:
    result, checkpoints = run / "result.json", list_checkpoints(run / "checkpoints")
    if not result.exists() and not checkpoints:
        raise UsageError(f"{run} holds no training run; give SETTING=FOLDER of `hop train`.")
    file = result if result.exists() else checkpoints[-1] / "state.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    history = content["history"] if result.exists() else content["tree"]["history"]
    if not history:
        raise UsageError(f"The run in {run} has no trial yet; train on with `hop train --resume`.")
    return list(history)
