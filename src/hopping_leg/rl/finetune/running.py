"""One continued training with its folder: what was asked for, the policy, the numbers."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.controllers.hardware_trial import TrialRobot
from hopping_leg.io import write_atomically, write_json
from hopping_leg.rl.finetune.config import FinetuneConfig, Task
from hopping_leg.rl.finetune.finetuning import Finetuning, Row
from hopping_leg.rl.run_folder import (
    as_stored,
    check_same,
    is_new,
    library_versions,
    read_json,
    refuse_finished,
)

RESULT = "finetune.json"
POLICY = "policy.onnx"


def finetune(
    task: Task,
    robot: TrialRobot,
    options: FinetuneConfig,
    out: Path,
    *,
    resume: bool = False,
    pretraining: Path | None = None,
    on_trial: Callable[[Row], None] = lambda _: None,
) -> dict[str, Any]:
    """Continue a policy's training and leave policy, card and numbers in a folder.

    Args:
        task: Policy, believed robot, range of commands, seed.
        robot: The real one, or what plays it.
        options: What is asked for.
        out: The run's folder.
        resume: Go on with the run in ``out``; without one, begin.
        pretraining: Folder of what is learnt beforehand, if others share it.
        on_trial: Called with every trial's row.

    Returns:
        The content of ``finetune.json``.

    Raises:
        UsageError: ``out`` holds a run that cannot be continued like this.
    """
    asked = as_stored(
        {
            "policy": task.policy.name,
            "policy_digest": task.policy.digest,
            "robot": task.robot.name,
            "robot_digest": task.robot.digest,
            "on": robot.name,
            "seed": task.seed,
            "options": asdict(options),
        }
    )
    if is_new(out, resume=resume):
        write_json(out / "config.json", asked)
    else:
        check_same(out, read_json(out / "config.json"), asked)
        refuse_finished(out / POLICY)
    finetuning = Finetuning(task, robot, options, out, pretraining, on_trial)
    content, reason = finetuning.run()
    result = {**asked, **summary(finetuning.rows, reason), "versions": library_versions()}
    write_json(out / RESULT, result)
    write_atomically(out / "model_card.md", card(result).encode())
    write_atomically(out / POLICY, content)
    return result


def summary(rows: list[Row], reason: str) -> dict[str, Any]:
    """Return what a finished run comes to, as JSON values."""
    checks = [row for row in rows if row["kind"] == "check"]
    best = min(checks, key=lambda row: float(row["error_m"])) if checks else None
    return {
        "why_it_ended": reason,
        "minutes": rows[-1]["minutes"] if rows else 0.0,
        "best_check": best,
        "first_check": checks[0] if checks else None,
        "safety": {
            "ended_early": sum(bool(row["complaint"]) for row in rows),
            "complaints": sorted({row["complaint"] for row in rows if row["complaint"]}),
            "rolled_back": sum(row["rolled_back"] for row in rows),
        },
        "outings": rows,
    }


def card(result: dict[str, Any]) -> str:
    """Return the model card of a finished run, as Markdown, from its ``finetune.json``."""
    best, first = result["best_check"], result["first_check"]
    lines = [
        f"# Policy `{result['policy']}`, continued on `{result['on']}`\n",
        f"Source: policy `{result['policy']}` ({result['policy_digest']}), believed robot"
        f" `{result['robot']}` ({result['robot_digest']}), seed {result['seed']}, method"
        f" `{result['options']['method']}`.\n",
        f"- Robot time: {result['minutes']:.1f} min in {len(result['outings'])} trials."
        f" {result['why_it_ended']}",
        f"- Ended early: {result['safety']['ended_early']}; rolled back:"
        f" {result['safety']['rolled_back']}.",
    ]
    if best:
        lines.append(
            f"- Median |apex - command| as estimated from the joints: {1e3 * first['error_m']:.1f}"
            f" mm on the first check, {1e3 * best['error_m']:.1f} mm on the best, which chose it."
        )
    return "\n".join(lines) + "\n"
