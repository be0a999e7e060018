"""Train from several starts side by side and keep the policy of the best.

A training may fail by bad luck, as its teachers may. Trainings of one thread each, one per core,
also learn more in the same time than one of several threads.
"""

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopping_leg.control.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.json_files import write_json
from hopping_leg.learn.crew import work_here
from hopping_leg.learn.dashboards import Log
from hopping_leg.learn.judge import DECIDING_SEEDS, as_rows, every_centimetre, judge, score
from hopping_leg.learn.model_card import write_card
from hopping_leg.learn.recipe import Recipe
from hopping_leg.learn.run_folder import RunFolder, read_result
from hopping_leg.learn.scale import fit
from hopping_leg.learn.train import Trained, check, train
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import write_atomically

_DECISION = "decision.json"


@dataclass(frozen=True)
class Starts:
    """Several trainings of a recipe that differ in their seeds.

    Attributes:
        recipe: What to train; scaled to the robot's size.
        robot: The leg.
        seed: Of all of them together; the k-th of n has seed ``n * seed + k``, so that no two
            seeds share a start.
        out: Folder in which each has its own, and in which the best policy is left.
        count: How many.
        minutes: Wall-clock time after which each stops learning; None for the recipe's steps.
        threads: Of each.
        quiet: Show no progress.
        log: Who gets the curves besides TensorBoard.
    """

    recipe: Recipe
    robot: Robot
    seed: int
    out: Path
    count: int
    minutes: float | None = None
    threads: int = 1
    quiet: bool = False
    log: Log = "tensorboard"

    def train(self, *, resume: bool = False) -> Trained:
        """Train all of them, each in a process of its own, and choose.

        Args:
            resume: Go on with those in ``out``; without any, begin.

        Raises:
            UsageError: ``out`` holds something else, what ``log`` needs is not installed, or one
                of the trainings ended early.
            RobotError: The robot has effects that training does not simulate.
        """
        if self.count < 2:
            raise UsageError(f"--starts is {self.count} but several are at least 2.")
        check(self.robot, self.minutes, self.log)
        recipe = fit(self.recipe, self.robot)
        folder = RunFolder(self.out, recipe, self.robot, self.seed, self.minutes, starts=self.count)
        folder.begin(resume=resume)
        work_here(self.work, self.count)
        return self._choose(folder)

    def folder(self, number: int) -> Path:
        """Return the folder of a start."""
        return self.out / f"start-{number}"

    def work(self, number: int) -> None:
        """Train one of them, or go on, and try its policy where the starts are compared.

        Only the first shows its progress: all take about as long.
        """
        folder, seed = self.folder(number), self.count * self.seed + number
        policy = folder / "policy.onnx"
        if not policy.exists():
            train(
                self.recipe,
                self.robot,
                seed,
                folder,
                resume=True,
                minutes=self.minutes,
                threads=self.threads,
                quiet=self.quiet or number > 0,
                log=self.log,
            )
        if not (folder / _DECISION).exists():
            began = time.monotonic()
            commands = every_centimetre(fit(self.recipe, self.robot).judge_commands)
            verdicts = judge(
                Policy(policy.read_bytes(), policy.stem, self.recipe.name),
                self.robot,
                commands,
                DECIDING_SEEDS,
                self.recipe.task.rate,
                self.threads,
            )
            decision = {
                "score_m": score(verdicts),
                "deciding_minutes": (time.monotonic() - began) / 60,
                "trials": as_rows(verdicts),
            }
            write_json(folder / _DECISION, decision)

    def _choose(self, folder: RunFolder) -> Trained:
        rows = [self._row(number) for number in range(self.count)]
        best = min(range(self.count), key=lambda number: float(rows[number]["score_m"]))
        chosen = self.folder(best)
        result = {
            **read_result(chosen),
            **folder.config,
            "command": folder.command,
            "minutes": max(row["minutes"] + row["deciding_minutes"] for row in rows),
            "starts_tried": rows,
            "deciding_seeds": list(DECIDING_SEEDS),
            "chosen_start": best,
        }
        folder.write("result.json", result)
        write_card(folder.path)
        write_atomically(folder.policy, (chosen / "policy.onnx").read_bytes())
        trials = rows[best]["trials"]
        return Trained(folder.policy, folder.path, result["minutes"], result["steps"], trials)

    def _row(self, number: int) -> dict[str, Any]:
        """Return how a start did, as JSON values."""
        folder = self.folder(number)
        result = read_result(folder)
        decision = json.loads((folder / _DECISION).read_text(encoding="utf-8"))
        kept = ("seed", "minutes", "steps")
        exams = result.get("exam_scores_m", [])
        return {**{key: result[key] for key in kept}, "exam_scores_m": exams, **decision}
