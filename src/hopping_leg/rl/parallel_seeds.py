"""Train with several seeds side by side, and go on with the best.

A training may fail by bad luck, its teacher above all, and trainings of one thread each learn more
on as many cores than one of several threads. So all begin, each in a process of its own; as soon as
the recipe can tell how each is likely to end, the best one goes on alone, with the threads of all.
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopping_leg import errors, io
from hopping_leg.controllers.policy import Policy
from hopping_leg.rl import loggers, model_card, policy_evaluation, run_folder
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.train import Trained, check, train
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers

_DECISION = "decision.json"


class _ComparableError(Exception):
    """A training can be compared with the others."""


@dataclass(frozen=True)
class ParallelSeeds:
    """Several trainings of a recipe that differ in their seeds; options are those of ``train``."""

    recipe: Recipe
    robot: Robot
    seed: int
    """Seed of all together; the k-th of n has ``n * seed + k``, so that none is taken twice."""
    out: Path
    """Folder in which each has its own, and in which the policy is left; a single one's own."""
    count: int
    """Trainings side by side."""
    minutes: float | None = None
    threads: int = 1
    """Threads of each."""
    quiet: bool = False
    log: loggers.Log = "tensorboard"
    source: Path | None = None

    def train(self, *, resume: bool = False) -> Trained:
        """Begin all of them, or with ``resume`` go on with those in ``out``; finish the best one.

        Raises ``UsageError`` where there is none or several from one source, ``out`` holds
        something else, ``log`` lacks what it needs or a training ended early, and ``RobotError`` as
        ``train`` does.
        """
        if self.count < 1:
            raise errors.UsageError(f"--parallel-seeds is {self.count} but must be at least 1.")
        if self.count == 1:
            return self._train(0, self.threads, resume=resume, quiet=self.quiet)
        if self.source is not None:
            raise errors.UsageError(
                "--source begins from one run's checkpoint; leave --parallel-seeds out."
            )
        if self.recipe.source is not None:
            raise errors.UsageError(
                f"Recipe {self.recipe.source} is known to this process alone; leave"
                " --parallel-seeds out and train one --seed after the other."
            )
        check(self.robot, self.minutes, self.log)
        recipe = self.recipe.fit(self.robot)
        folder = run_folder.RunFolder(
            self.out, recipe, self.robot, self.seed, self.minutes, parallel_seeds=self.count
        )
        folder.begin(resume=resume)
        if any(self._decision(number) is None for number in range(self.count)):
            compile_physics()
            with ProcessWorkers(self.count) as workers:
                workers.map(self.work, ((number,) for number in range(self.count)))
        return self._finish(folder)

    def folder(self, number: int) -> Path:
        """Return the folder of one of them."""
        return self.out if self.count == 1 else self.out / f"start-{number}"

    def work(self, number: int) -> None:
        """Train one of them, or go on, until it can be compared; leave what decides.

        Only the first shows its progress: all take about as long.
        """
        if self._decision(number) is not None:
            return
        folder = self.folder(number)
        try:
            if not (folder / "policy.onnx").exists():
                quiet = self.quiet or number > 0
                self._train(number, self.threads, quiet=quiet, on_early_score=_stop)
            decision = self._try(folder)
        except _ComparableError as early_score:
            decision = dict(zip(("score_m", "minutes"), early_score.args, strict=True))
        io.write_json(folder / _DECISION, {"seed": self._seed(number), **decision})

    def _train(
        self,
        number: int,
        threads: int,
        *,
        resume: bool = True,
        quiet: bool,
        on_early_score: Callable[[float, float], None] | None = None,
    ) -> Trained:
        return train(
            self.recipe,
            self.robot,
            self._seed(number),
            self.folder(number),
            resume=resume,
            source=self.source,
            minutes=self.minutes,
            threads=threads,
            quiet=quiet,
            log=self.log,
            on_early_score=on_early_score,
        )

    def _seed(self, number: int) -> int:
        return self.count * self.seed + number

    def _try(self, folder: Path) -> dict[str, Any]:
        """Try the policy of a finished training at every centimetre."""
        began = time.monotonic()
        policy = Policy((folder / "policy.onnx").read_bytes(), folder.name, self.recipe.name)
        commands = policy_evaluation.every_centimetre(
            self.recipe.fit(self.robot).selection.eval_commands
        )
        rate = self.recipe.task.rate
        results = policy_evaluation.evaluate_policy(
            policy, self.robot, commands, policy_evaluation.DECIDING_SEEDS, rate, self.threads
        )
        minutes = run_folder.read_result(folder)["minutes"] + (time.monotonic() - began) / 60
        return {
            "score_m": policy_evaluation.score(results),
            "minutes": minutes,
            "trials": policy_evaluation.as_rows(results),
        }

    def _decision(self, number: int) -> dict[str, Any] | None:
        """Return what decides about one of them: seed, score in m, and minutes until then."""
        file = self.folder(number) / _DECISION
        return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None

    def _finish(self, folder: run_folder.RunFolder) -> Trained:
        """Go on with the best of them where it is not finished, and keep its policy."""
        decisions = [d for number in range(self.count) if (d := self._decision(number))]
        chosen = min(range(self.count), key=lambda number: float(decisions[number]["score_m"]))
        best = self.folder(chosen)
        if not (best / "policy.onnx").exists():
            self._train(chosen, self.count * self.threads, quiet=self.quiet)
        # The last of them to be comparable is waited for.
        slowest = max(decision["minutes"] for decision in decisions)
        own = run_folder.read_result(best)
        result = {
            **own,
            **folder.config,
            "command": folder.command,
            "minutes": max(own["minutes"] + slowest - decisions[chosen]["minutes"], slowest),
            "seed_scores": decisions,
            "chosen_seed": chosen,
        }
        folder.write("result.json", result)
        model_card.write_card(folder.path)
        io.write_atomically(folder.policy, (best / "policy.onnx").read_bytes())
        return Trained(folder.policy, result["minutes"], own["steps"])


def _stop(early_score: float, minutes: float) -> None:
    raise _ComparableError(early_score, minutes)
