"""Which snapshot of a training becomes its policy."""

from typing import Any

from hopping_leg import io
from hopping_leg.controllers.policy import Policy
from hopping_leg.rl import policy_evaluation
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.run_folder import RunFolder
from hopping_leg.robot.parameters import Robot

FINALISTS = 4
"""Snapshots that are tried once more at the end."""


class Selection:
    """Tries every snapshot on one seed; the best few again on others, and one of those wins."""

    def __init__(self, recipe: Recipe, robot: Robot, folder: RunFolder) -> None:
        self._recipe, self._robot, self._folder = recipe, robot, folder
        self.rows: list[dict[str, Any]] = []
        """Every snapshot so far: steps, minutes, score and trials, as JSON values."""

    @property
    def next_at(self) -> int:
        """Steps after which the next snapshot is due."""
        every = self._recipe.selection.eval_every
        return every * (self.rows[-1]["steps"] // every + 1) if self.rows else every

    def add(self, steps: int, minutes: float, content: bytes) -> dict[str, Any]:
        """Keep and try a policy file; return its row."""
        io.write_atomically(self._folder.snapshot(steps), content)
        row = {"steps": steps, "minutes": minutes, **self.trials(content)}
        self.rows.append(row)
        return row

    def choose(self) -> tuple[bytes, dict[str, Any]]:
        """Return the best policy file and its row, with the scores of all finalists."""
        if len(self.rows) == 1 and self._recipe.selection.calibrations:
            content = self._folder.snapshot(self.rows[0]["steps"]).read_bytes()
            return content, {**self.rows[0], "seeds": list(policy_evaluation.FINAL_SEEDS)}
        ranked = sorted(self.rows, key=lambda row: float(row["score_m"]))[:FINALISTS]
        finals = []
        for row in ranked:
            content = self._folder.snapshot(row["steps"]).read_bytes()
            tried = {"steps": row["steps"], "minutes": row["minutes"], **self.final(content)}
            finals.append((tried, content))
        best, content = min(finals, key=lambda final: float(final[0]["score_m"]))
        scores = [{"steps": row["steps"], "score_m": row["score_m"]} for row, _ in finals]
        return content, {**best, "finalists": scores, "seeds": list(policy_evaluation.FINAL_SEEDS)}

    def final(self, content: bytes) -> dict[str, Any]:
        """Try a policy file on the seeds that judge the best."""
        return self.trials(content, policy_evaluation.FINAL_SEEDS)

    def trials(
        self, content: bytes, seeds: tuple[int, ...] = (policy_evaluation.FIRST_SEED,)
    ) -> dict[str, Any]:
        """Return score, m, and trials of a policy file, as JSON values."""
        recipe = self._recipe
        policy = Policy(content, "snapshot", recipe.name)
        policy.set_robot(self._robot)
        results = policy_evaluation.evaluate_policy(
            policy, self._robot, recipe.selection.eval_commands, seeds, recipe.task.rate
        )
        return {
            "score_m": policy_evaluation.score(results),
            "worst_score_m": max(map(policy_evaluation.command_score, results)),
            "trials": policy_evaluation.as_rows(results),
        }
