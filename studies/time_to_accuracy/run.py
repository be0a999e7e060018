"""From scratch to accurate hopping: accuracy over wall-clock time, and what the time is spent on.

A distillation is judged by its finished policy, and trained anew for every share of its steps,
since its schedules end with them; of the others, which may be stopped at any time, snapshots of one
training are judged. Times are whole: building the networks, evaluations and calibration are in
them. They are wall-clock times of two threads, for other libraries CPU times of one. All policies
are judged on seeds that chose nothing, at the heights and on the robot that they were trained for.
"""

import json
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.cli.options import JsonFile
from hopping_leg.controllers.policy import Policy
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.figures import controller_colours, encode, panels, styled
from hopping_leg.io import write_atomically
from hopping_leg.rl.policy_evaluation import CommandResult, evaluate_policy
from hopping_leg.rl.recipes import RECIPES
from hopping_leg.rl.run_folder import read_result
from hopping_leg.rl.train import train
from hopping_leg.robot import DEFAULT_ROBOT, Robot, load_robot
from studies.shared import ROOT, Row, once, show_rows
from studies.time_to_accuracy import libraries

JUDGING_SEEDS = (1000, 1001)  # Of noise and delay; they chose nothing

_PPO, _PAPER = RECIPES["rl"], RECIPES["paper"].replace(actor=(128, 128), eval_every=10**9)
TRAINED = {
    "paper-ppo": _PAPER.replace(algorithm=_PPO.algorithm, schedule=_PPO.schedule),
    **RECIPES,
}
TRAINED["paper-ppo-no-soft-limits"] = TRAINED["paper-ppo"].replace({"task.soft_limits": None})
"""Recipes, and another learner on the paper's reward: what that can reach."""

SHARES = {"fast": (0.25, 0.5, 1.0)}  # Of the steps of recipes whose schedules end with them

_SPACING = 0.02


@dataclass(frozen=True)
class TimeToAccuracy:
    """Train recipes and other libraries' algorithms from scratch; judge them over time."""

    recipes: tuple[str, ...] = ("rl", "fast", "paper", *libraries.ALGORITHMS)
    """Recipes, paper-ppo, paper-ppo-no-soft-limits, and algorithms as sb3-ppo, sbx-tqc."""
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    """One training each."""
    robot: str | None = None
    """A shipped name or the path of a .toml file; by default each recipe's own."""
    minutes: float = 5.0
    """CPU time of each training of another library's algorithm."""
    out: Path = Path("runs/time_to_accuracy")
    """Where the trainings are kept: finished ones are not repeated, killed ones go on."""
    figure: Path | None = None
    """Draw the curves to this .svg file, beside those of all stored results."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print a table, return every number."""
        rows: list[Row] = []
        spent: list[Row] = []
        for recipe in self.recipes:
            asked = {"robot": self._robot(recipe).digest, "minutes": self.minutes}
            asked |= {"options": repr(TRAINED.get(recipe)), "shares": SHARES.get(recipe)}
            for seed in self.seeds:
                file = self.out / "judged" / f"{recipe}-{seed}.json"
                found = once(file, asked, self._train, recipe, seed)
                rows += [{"recipe": recipe, "seed": seed, **row} for row in found["rows"]]
                spent += [{"recipe": recipe, "seed": seed, **found["spent"]}]
        summary = summarise(rows)
        lengths = ("mean_error_m", "worst_seed_mean_error_m", "mean_std_m")
        show_rows(summary, "recipe", "seconds", *lengths, "skipped_hops")
        if self.figure is not None:
            stored = sorted(ROOT.glob("studies/time_to_accuracy/results/*.json"))
            drawn = [row for file in stored for row in json.loads(file.read_text())["rows"]]
            write_atomically(self.figure, encode(draw(rows + drawn), "svg"))
        return {
            "robots": {name: self._robot(name).name for name in self.recipes},
            "rows": rows,
            "summary": summary,
            "spent": _mean_spent(spent),
            "judging_seeds": JUDGING_SEEDS,
            "versions": software_versions(),
        }

    def _train(self, recipe: str, seed: int) -> Row:
        """Train and judge; return rows over time, and what the last training spent time on."""
        robot = self._robot(recipe)
        if recipe in libraries.ALGORITHMS:
            found = libraries.learn(recipe, robot, seed, self.minutes, snapshots=12)
            rows = [{"seconds": s, "steps": n, **judge(content, robot)} for s, n, content in found]
            return {"rows": rows, "spent": {}}
        rows, result, whole = [], {}, TRAINED[recipe]
        for share in SHARES.get(recipe, (1.0,)):
            folder = self.out / f"{recipe}-{seed}" / f"{share:g}"
            if not (folder / "policy.onnx").exists():
                made = whole.replace(steps=int(share * whole.schedule.steps))
                train(made, robot, seed, folder, threads=2, resume=folder.exists())
            result = read_result(folder)
            if len(result["history"]) == 1:  # tried at its end alone
                policies = [(60 * result["minutes"], result["steps"], folder / "policy.onnx")]
            else:
                snapshots = (folder / "snapshots").glob("*.onnx")
                times = {row["steps"]: 60 * row["minutes"] for row in result["history"]}
                policies = [(times[int(f.stem)], int(f.stem), f) for f in sorted(snapshots)]
            for seconds, steps, file in policies:
                judged = judge(file.read_bytes(), robot, soft_limits=whole.task.soft_limits)
                rows.append({"seconds": seconds, "steps": steps, **judged})
        return {"rows": rows, "spent": result["seconds"]}

    def _robot(self, recipe: str) -> Robot:
        usual = TRAINED[recipe].robot if recipe in TRAINED else DEFAULT_ROBOT
        return load_robot(self.robot or usual)


def judge(content: bytes, robot: Robot, **world: Any) -> Row:  # noqa: ANN401
    """Return the accuracy of a policy file every 2 cm of its range, or at the paper's heights."""
    policy = Policy(content, "policy", "policy")
    policy.set_robot(robot)
    low, high = max(policy.card.command_low, 0.22), policy.card.command_high
    heights = tuple(np.arange(low, high + 1e-6, _SPACING).round(3).tolist())
    if (low, high) == (0.25, 0.35):
        heights = (0.25, 0.30, 0.35)
    tried = evaluate_policy(policy, robot, heights, JUDGING_SEEDS, **world)
    return over_commands(tried)


def over_commands(results: list[CommandResult]) -> Row:
    """Return accuracy over the commands; where a policy does not hop, the command is its error."""
    errors = [abs(r.median_error_m) if r.hops else r.command_m for r in results]
    return {
        "commands": len(results),
        "mean_abs_median_error_m": float(np.mean(errors)),
        "worst_abs_median_error_m": float(np.max(errors)),
        "mean_offset_m": float(np.mean([r.median_error_m for r in results if r.hops] or [0.0])),
        "mean_std_m": float(np.mean([r.std_m for r in results if r.hops] or [0.0])),
        "skipped_hops": sum(r.skipped_hops for r in results),
        "body_contact_ticks": sum(r.body_contact_ticks for r in results),
    }


def summarise(rows: list[Row]) -> list[Row]:
    """Return means over seeds for every recipe and point in time, in order."""
    numbered = [
        {**row, "point": point}
        for _, group in groupby(rows, key=lambda row: (row["recipe"], row["seed"]))
        for point, row in enumerate(group)
    ]
    found = []
    for name, point in dict.fromkeys((row["recipe"], row["point"]) for row in numbered):
        there = [row for row in numbered if (row["recipe"], row["point"]) == (name, point)]
        errors = [row["mean_abs_median_error_m"] for row in there]
        found.append({
            "recipe": name,
            "seconds": float(np.mean([row["seconds"] for row in there])),
            "runs": len(there),
            "mean_error_m": float(np.mean(errors)),
            "worst_seed_mean_error_m": float(np.max(errors)),
            "mean_offset_m": float(np.mean([row["mean_offset_m"] for row in there])),
            "mean_std_m": float(np.mean([row["mean_std_m"] for row in there])),
            "skipped_hops": sum(row["skipped_hops"] for row in there),
        })  # fmt: skip
    return found


def _mean_spent(spent: list[Row]) -> list[Row]:
    """Return the mean time of every part of a recipe's last training."""
    found = []
    for name in dict.fromkeys(row["recipe"] for row in spent):
        own = [row for row in spent if row["recipe"] == name]
        for part in (key for key in own[0] if key not in ("recipe", "seed")):
            seconds = float(np.mean([row[part] for row in own]))
            found.append({"recipe": name, "part": part, "seconds": seconds})
    return found


@styled
def draw(rows: list[Row]) -> Figure:
    """Draw error and scatter over time, a line per seed; what does not hop has no scatter."""
    figure, axes = panels(2)
    colours = controller_colours(row["recipe"] for row in rows)
    keys = ("mean_abs_median_error_m", "mean_std_m")
    for (axis,), key, title in zip(axes, keys, ("mean |error| / mm", "mean std / mm"), strict=True):
        for mark, (name, colour) in zip("os^vDP*Xd<>" * 2, colours.items(), strict=False):
            own = [row for row in rows if row["recipe"] == name]
            for number, seed in enumerate(dict.fromkeys(row["seed"] for row in own)):
                line = [row for row in own if row["seed"] == seed]
                label = name if number == 0 else None
                seconds = [row["seconds"] for row in line]
                shown = [1e3 * row[key] or np.nan for row in line]
                axis.plot(seconds, shown, f"{mark}-", color=colour, lw=0.6, ms=3, label=label)
        axis.set(xscale="log", yscale="log", ylim=(0.2, 500))
        for side in (axis.xaxis, axis.yaxis):
            side.set_major_formatter("{x:g}")
        axis.set_ylabel(title)
    axes[0][0].legend(ncol=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes[-1][0].set_xlabel("time / s")
    return figure
