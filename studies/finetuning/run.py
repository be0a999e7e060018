"""Continued training measured: on twins, with several seeds, judged on seeds that chose nothing.

The policy at the start and the one that each run chose hop on the twin once more, at heights
between those of the trials, too; there the true apexes count.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.finetune import guard_of
from hopping_leg.cli.options import at_least, mm
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.figure_style import WIDTH, colour, styled
from hopping_leg.io import write_atomically, write_json
from hopping_leg.rl.finetune.finetuning import (
    POLICY,
    RESULT,
    FinetuneConfig,
    Row,
    StoppingRules,
    Task,
    finetune,
)
from hopping_leg.rl.finetune.simulated import Guard, SimulatedTrials
from hopping_leg.rl.finetune.trial_data import score
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from hopping_leg.sim.randomization import draw_twin
from hopping_leg.terminal import plain_console

FIRST_JUDGE = 1000
"""Of the seeds that judge; none of them has chosen anything."""

_SECONDS = 5.0
"""At each height in a judging trial."""

START, CONTINUED = "start", "continued"
"""The policy before and after."""


@dataclass(frozen=True)
class Study:
    """What is compared, and where it is kept."""

    policy: Policy
    believed: Robot
    twins: tuple[Robot, ...]
    seeds: tuple[int, ...]
    options: FinetuneConfig
    guard: Guard
    folder: Path
    eval_commands: tuple[float, ...] = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
    judges: int = 3
    """Judging trials of each policy."""


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
            where = {"twin": twin.name, "seed": seed}
            result = _run(study, twin, seed, on_progress)
            curves += [{**where, **_point(row)} for row in result["trials"]]
            runs.append({**where, **_ending(result)})
            path = _folder(study, twin, seed) / POLICY
            judged += _judge(study, twin, Policy.load(path), CONTINUED, seed)
    return {
        "policy": study.policy.name,
        "believed": study.believed.name,
        "judge_seeds": [FIRST_JUDGE, FIRST_JUDGE + study.judges - 1],
        "rows": [_pooled(twin.name, which, judged) for twin in study.twins
                 for which in (START, CONTINUED)],
        "runs": runs,
        "judged": judged,
        "curves": curves,
    }  # fmt: skip


def _folder(study: Study, twin: Robot, seed: int) -> Path:
    return study.folder / f"{twin.name}-seed{seed}"


def _run(
    study: Study, twin: Robot, seed: int, on_progress: Callable[[str], None]
) -> dict[str, Any]:
    folder = _folder(study, twin, seed)
    if not (folder / POLICY).exists():
        finetune(
            Task(study.policy, study.believed, seed),
            SimulatedTrials(twin, study.guard),
            study.options,
            folder,
            resume=True,
            pretraining=study.folder / "pretraining",
            on_trial=lambda row: on_progress(
                f"{folder.name} {row['minutes']:.2f} min: {1e3 * row['error_m']:.0f} mm"
            ),
        )
    result: dict[str, Any] = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    return result


def _judge(study: Study, twin: Robot, policy: Policy, which: str, seed: int | None) -> list[Row]:
    """Return true errors of a policy at every height and judging seed; kept in a file."""
    name = f"{twin.name}-{which}" + ("" if seed is None else f"-seed{seed}")
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
        trial = SimulatedTrials(twin, study.guard).hop(policy, schedule, judge)
        assert trial.truth is not None
        found = score(trial.truth, schedule, trial.complaint)
        rows += [
            {
                "twin": twin.name,
                "policy": which,
                "seed": seed,
                "judge": judge,
                "command_m": command,
                "median_abs_error_m": error,
                "median_error_m": found.offsets[command],
                "ended_early": bool(trial.complaint),
            }
            for command, error in found.by_command.items()
        ]
    write_json(path, {"asked": asked, "rows": rows})
    return rows


def _pooled(twin: str, which: str, judged: list[Row]) -> Row:
    """Return one row over seeds, judges and heights."""
    mine = [row for row in judged if (row["twin"], row["policy"]) == (twin, which)]
    seeds = list(dict.fromkeys(row["seed"] for row in mine))
    errors = [
        float(np.mean([row["median_abs_error_m"] for row in mine if row["seed"] == seed]))
        for seed in seeds
    ]
    return {
        "twin": twin,
        "policy": which,
        "policies": len(seeds),
        "median_abs_error_m": float(np.median(errors)),
        "best_m": min(errors),
        "worst_m": max(errors),
        "ended_early": sum(row["ended_early"] for row in mine) // len({row["command_m"]
                           for row in mine}),
    }  # fmt: skip


def _point(row: Row) -> Row:
    names = ("trial", "minutes", "error_m", "true_error_m", "rolled_back")
    return {**{name: row[name] for name in names}, "ended_early": bool(row["complaint"])}


def _ending(result: dict[str, Any]) -> Row:
    return {
        "minutes": result["minutes"],
        "why_it_ended": result["why_it_ended"],
        "ended_early": result["safety"]["ended_early"],
        "rolled_back": result["safety"]["rolled_back"],
        "first_estimated_error_m": result["first_trial"]["error_m"],
        "best_estimated_error_m": result["best_trial"]["error_m"],
    }


@dataclass(frozen=True)
class Finetune:
    """Continue a policy's training on drawn twins; judge it on other seeds."""

    policy: str = "fast"
    """A shipped policy or an .onnx file."""
    robot: str = DEFAULT_ROBOT
    """What is believed of the leg; the twins are drawn around it."""
    twins: tuple[int, ...] = (0, 1)
    """Seeds of the twins."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of the runs, one of each twin."""
    minutes: float = 10.0
    """Robot time of a run at most."""
    judges: int = 3
    """Judging trials of each policy."""
    folder: Path = Path("runs/bench-finetune")
    """Where the runs are kept; finished ones are not repeated, killed ones go on."""
    figure: Path | None = None
    """Draw the errors over robot time to this file, .svg."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.figure_style import to_svg

        at_least(1, judges=self.judges)
        at_least(0, **{f"seeds {seed}": seed for seed in (*self.seeds, *self.twins)})
        if not (self.twins and self.seeds):
            raise UsageError("--twins and --seeds each need at least one entry.")
        policy, robot = load_policy(self.policy), load_robot(self.robot)
        console = plain_console()
        result = measure(
            Study(
                policy,
                robot,
                tuple(draw_twin(seed, self.robot).robot for seed in self.twins),
                self.seeds,
                FinetuneConfig(stopping_rules=StoppingRules(minutes=self.minutes)),
                guard_of(robot, policy.card.rate),
                self.folder,
                judges=self.judges,
            ),
            lambda text: console.print(text, highlight=False),
        )
        if self.figure is not None:
            write_atomically(self.figure, to_svg(draw_finetuning(result)))
        _print(console, result)
        return result


def _print(console: Console, result: dict[str, Any]) -> None:
    table = Table("twin", "policy", "|error|, mm", "best seed", "worst seed", "ended early")
    for row in result["rows"]:
        numbers = [mm(row[key]) for key in ("median_abs_error_m", "best_m", "worst_m")]
        table.add_row(row["twin"], row["policy"], *numbers, str(row["ended_early"]))
    console.print(table)


_TOP = 0.97
"""Where crosses are drawn, of the panel's height."""


@styled
def draw_finetuning(result: dict[str, Any]) -> Figure:
    """Draw the true error of every trial, one panel per twin, a line per seed.

    Args:
        result: What the study measured; estimated errors are drawn as dots, trials that were
            ended early, which have no error, as crosses at the top.
    """
    curves = result["curves"]
    twins = list(dict.fromkeys(row["twin"] for row in curves))
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    panels = figure.subplots(1, len(twins), sharey=True, squeeze=False)[0]
    for panel, twin in zip(panels, twins, strict=True):
        _draw(panel, [row for row in curves if row["twin"] == twin])
        panel.set_title(twin)
        panel.set_xlabel("robot time / min")
        panel.margins(y=0.12)
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("median |apex − command| / mm")
    return figure


def _draw(panel: Axes, rows: list[dict[str, Any]]) -> None:
    """Draw a line per seed, a dot per estimate and a cross per trial that was ended early."""
    for index, seed in enumerate(dict.fromkeys(row["seed"] for row in rows)):
        mine, shade = [row for row in rows if row["seed"] == seed], colour(index)
        whole = [row for row in mine if not row["ended_early"]]
        minutes = [row["minutes"] for row in whole]
        panel.plot(minutes, [1e3 * r["true_error_m"] for r in whole], color=shade, linewidth=1.2)
        panel.plot(minutes, [1e3 * r["error_m"] for r in whole], ".", color=shade, markersize=4)
        ended = [row["minutes"] for row in mine if row["ended_early"]]
        panel.plot(
            ended, [_TOP] * len(ended), "x", color=shade, markersize=4,
            transform=panel.get_xaxis_transform(),
        )  # fmt: skip
