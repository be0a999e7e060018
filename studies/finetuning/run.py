"""Continued training measured: methods on twins, several seeds, judged on seeds that chose nothing.

The policy at the start and the one that each run chose hop on the twin once more, without
exploration, at heights between those of the checks, too; there the true apexes count.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.io import write_json
from hopping_leg.rl.finetune.config import FinetuneConfig, Method
from hopping_leg.rl.finetune.finetuning import Row
from hopping_leg.rl.finetune.pretraining import Task
from hopping_leg.rl.finetune.running import POLICY, RESULT, finetune
from hopping_leg.rl.finetune.simulated import Guard, SimulatedTrials
from hopping_leg.rl.finetune.trial_data import score
from hopping_leg.robot.parameters import Robot

FIRST_JUDGE = 1000
"""Of the seeds that judge; none of them has chosen anything."""

_SECONDS = 5.0
"""At each height in a judging outing."""

START = "start"
"""Stands for the method of the policy before it was continued."""


@dataclass(frozen=True)
class Study:
    """What is compared, and where it is kept."""

    policy: Policy
    believed: Robot
    twins: tuple[Robot, ...]
    methods: tuple[Method, ...]
    seeds: tuple[int, ...]
    options: FinetuneConfig
    guard: Guard
    folder: Path
    eval_commands: tuple[float, ...] = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
    judges: int = 3
    """Judging outings of each policy."""


def measure(study: Study, on_progress: Callable[[str], None]) -> dict[str, Any]:
    """Run the study, or what is left of it, and return its numbers.

    Args:
        study: What is compared.
        on_progress: Called with a line about what is done next or was done.

    Raises:
        UsageError: The folder holds runs of other options.
    """
    curves: list[Row] = []
    judged: list[Row] = []
    runs: list[Row] = []
    for twin in study.twins:
        on_progress(f"{study.policy.name} on {twin.name}")
        judged += _judge(study, twin, study.policy, START, None)
        for seed in study.seeds:
            for method in study.methods:
                where = {"twin": twin.name, "method": method, "seed": seed}
                result = _run(study, twin, method, seed, on_progress)
                curves += [{**where, **_point(row)} for row in result["outings"]]
                runs.append({**where, **_ending(result)})
                path = _folder(study, twin, method, seed) / POLICY
                judged += _judge(study, twin, Policy.load(path), method, seed)
    return {
        "policy": study.policy.name,
        "believed": study.believed.name,
        "judge_seeds": [FIRST_JUDGE, FIRST_JUDGE + study.judges - 1],
        "rows": [_pooled(twin.name, m, judged) for twin in study.twins
                 for m in (START, *study.methods)],
        "runs": runs,
        "judged": judged,
        "curves": curves,
    }  # fmt: skip


def _folder(study: Study, twin: Robot, method: str, seed: int) -> Path:
    return study.folder / f"{twin.name}-{method}-seed{seed}"


def _run(
    study: Study, twin: Robot, method: Method, seed: int, on_progress: Callable[[str], None]
) -> dict[str, Any]:
    folder = _folder(study, twin, method, seed)
    if not (folder / POLICY).exists():
        span = (min(study.options.commands), max(study.options.commands))
        finetune(
            Task(study.policy, study.believed, span, seed),
            SimulatedTrials(twin, study.guard),
            replace(study.options, method=method),
            folder,
            resume=True,
            pretraining=study.folder / "pretraining",
            on_outing=lambda row: on_progress(
                f"{folder.name} {row['minutes']:.2f} min: {1e3 * row['error_m']:.0f} mm"
            ),
        )
    result: dict[str, Any] = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    return result


def _judge(study: Study, twin: Robot, policy: Policy, method: str, seed: int | None) -> list[Row]:
    """Return true errors of a policy at every height and judging seed; kept in a file."""
    name = f"{twin.name}-{method}" + ("" if seed is None else f"-seed{seed}")
    asked = {"policy": policy.digest, "twin": twin.digest, "commands": list(study.eval_commands),
             "judges": study.judges}  # fmt: skip
    path = study.folder / "judged" / f"{name}.json"
    if path.exists():
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["asked"] == asked:
            return list(stored["rows"])
    schedule = CommandSchedule(tuple((c, _SECONDS) for c in study.eval_commands))
    rows = []
    for judge in range(FIRST_JUDGE, FIRST_JUDGE + study.judges):
        outing = SimulatedTrials(twin, study.guard).hop(policy, schedule, judge)
        assert outing.truth is not None
        found = score(outing.truth, schedule, outing.complaint)
        rows += [
            {
                "twin": twin.name,
                "method": method,
                "seed": seed,
                "judge": judge,
                "command_m": command,
                "median_abs_error_m": error,
                "median_error_m": found.offsets[command],
                "ended_early": bool(outing.complaint),
            }
            for command, error in found.by_command.items()
        ]
    write_json(path, {"asked": asked, "rows": rows})
    return rows


def _pooled(twin: str, method: str, judged: list[Row]) -> Row:
    """Return one row over seeds, judges and heights."""
    mine = [row for row in judged if (row["twin"], row["method"]) == (twin, method)]
    seeds = list(dict.fromkeys(row["seed"] for row in mine))
    errors = [
        float(np.mean([row["median_abs_error_m"] for row in mine if row["seed"] == seed]))
        for seed in seeds
    ]
    return {
        "twin": twin,
        "method": method,
        "policies": len(seeds),
        "median_abs_error_m": float(np.median(errors)),
        "best_m": min(errors),
        "worst_m": max(errors),
        "ended_early": sum(row["ended_early"] for row in mine) // len({row["command_m"]
                           for row in mine}),
    }  # fmt: skip


def _point(row: Row) -> Row:
    names = ("outing", "kind", "minutes", "error_m", "true_error_m", "rolled_back")
    return {**{name: row[name] for name in names}, "ended_early": bool(row["complaint"])}


def _ending(result: dict[str, Any]) -> Row:
    return {
        "minutes": result["minutes"],
        "why_it_ended": result["why_it_ended"],
        "ended_early": result["safety"]["ended_early"],
        "rolled_back": result["safety"]["rolled_back"],
        "first_estimated_error_m": result["first_check"]["error_m"],
        "best_estimated_error_m": result["best_check"]["error_m"],
    }
