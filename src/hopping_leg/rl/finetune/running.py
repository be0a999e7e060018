"""One continued training with its folder: what was asked for, the policy, the numbers."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hopping_leg.controllers.hardware_trial import TrialRobot
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically, write_json
from hopping_leg.rl.finetune.config import FinetuneConfig
from hopping_leg.rl.finetune.finetuning import Finetuned, Finetuning, Row
from hopping_leg.rl.finetune.pretraining import Task
from hopping_leg.rl.run_folder import library_versions

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
    on_outing: Callable[[Row], None] = lambda _: None,
) -> dict[str, Any]:
    """Continue a policy's training and leave policy, card and numbers in a folder.

    Args:
        task: Policy, believed robot, range of commands, seed.
        robot: The real one, or what plays it.
        options: What is asked for.
        out: The run's folder.
        resume: Go on with the run in ``out``; without one, begin.
        pretraining: Folder of what is learnt beforehand, if others share it.
        on_outing: Called with every outing's row.

    Returns:
        The content of ``finetune.json``.

    Raises:
        UsageError: ``out`` holds a run that cannot be continued like this.
    """
    asked = _asked(task, robot, options)
    _begin(out, asked, resume=resume)
    finetuned = Finetuning(task, robot, options, out, pretraining, on_outing).run()
    result = {**asked, **summary(finetuned), "versions": library_versions()}
    write_json(out / RESULT, result)
    write_atomically(out / "model_card.md", card(result).encode())
    write_atomically(out / POLICY, finetuned.content)
    return result


def summary(finetuned: Finetuned) -> dict[str, Any]:
    """Return what a finished run comes to, as JSON values."""
    rows = finetuned.rows
    checks = [row for row in rows if row["kind"] == "check"]
    best = min(checks, key=lambda row: float(row["error_m"])) if checks else None
    return {
        "why_it_ended": finetuned.reason,
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
    """Return the model card of a finished run as Markdown.

    Args:
        result: Content of ``finetune.json``.
    """
    best, first = result["best_check"], result["first_check"]
    lines = [
        f"# Policy `{result['policy']}`, continued on `{result['on']}`\n",
        f"Source: policy `{result['policy']}` ({result['policy_digest']}), believed robot"
        f" `{result['robot']}` ({result['robot_digest']}), seed {result['seed']}, method"
        f" `{result['options']['method']}`.\n",
        f"- Robot time: {result['minutes']:.1f} min in {len(result['outings'])} outings."
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


def _asked(task: Task, robot: TrialRobot, options: FinetuneConfig) -> dict[str, Any]:
    asked: dict[str, Any] = json.loads(
        json.dumps(
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
    )
    return asked


def _begin(out: Path, asked: dict[str, Any], *, resume: bool) -> None:
    file = out / "config.json"
    if not file.exists():
        if out.is_dir() and any(out.iterdir()):
            raise UsageError(f"{out} is not empty and holds no run; give another --out.")
        write_json(file, asked)
        return
    if not resume:
        raise UsageError(f"{out} already holds a run; go on with --resume or give another --out.")
    stored = json.loads(file.read_text(encoding="utf-8"))
    different = [key for key in asked if stored.get(key) != asked[key]]
    if different:
        raise UsageError(
            f"The run in {out} has another {different[0].replace('_', ' ')}; resume it with the"
            " options that it began with."
        )
    if (out / POLICY).exists():
        raise UsageError(f"The run in {out} is finished; its policy is {out / POLICY}.")
