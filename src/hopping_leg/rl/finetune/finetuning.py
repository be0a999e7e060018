"""Continue a policy's training on a robot: trials, corrections of the command, the best one kept.

Every trial hops through the same heights. Its error, as estimated from the joints, decides what is
best, what is rolled back and when to stop. All randomness follows from seed and number of the
trial, and all that is learnt from the rows of the trials, so that a run that was killed goes on
exactly.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import hardware_trial
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically, write_json
from hopping_leg.locks import hold_folder
from hopping_leg.rl import onnx_export, run_folder
from hopping_leg.rl.finetune import apex_estimate
from hopping_leg.rl.finetune.trial_data import Score, TrialData, estimated, score
from hopping_leg.robot.parameters import Robot

RESULT = "finetune.json"
POLICY = "policy.onnx"

Row = dict[str, Any]
"""Result of a trial, as JSON values."""


@dataclass(frozen=True)
class StoppingRules:
    """When to stop and when to roll back; errors are those estimated of trials."""

    minutes: float = 10.0
    """Robot time at most."""
    tolerance: float = 0.004
    """Error that is good enough, on two trials in a row, m."""
    margin: float = 0.01
    """Error above the best at which a policy is rolled back to it, m."""
    confirm: int = 2
    """Trials in a row that must be so bad: a few hops scatter."""
    gain: float = 0.0005
    """Less of an improvement counts for none, m."""
    patience: int = 8
    """Trials without an improvement after which the training ends."""

    def rolled_back(self, errors: Sequence[float]) -> bool:
        """Tell whether the last errors of trials, m, are too bad beside the best."""
        latest = errors[-self.confirm :]
        return len(latest) == self.confirm and min(latest) > min(errors) + self.margin

    def reason(self, errors: Sequence[float], minutes: float, following: float) -> str:
        """Return why to stop after errors of trials, m; empty for a next trial of minutes."""
        if len(errors) > 1 and max(errors[-2:]) <= self.tolerance:
            return f"The error is within {1e3 * self.tolerance:g} mm."
        if minutes + following > self.minutes + 1e-9:
            return f"The {self.minutes:g} minutes of robot time are used up."
        before, since = errors[: -self.patience], errors[-self.patience :]
        if before and min(since) > min(before) - self.gain:
            return f"Nothing improved in the last {self.patience} trials."
        return ""


@dataclass(frozen=True)
class FinetuneConfig:
    """Continued training on a robot."""

    commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Heights of every trial, m, rising."""
    trial_seconds: float = 15.0
    """Length of a trial, s."""
    rate: float = 0.6
    """Share of a trial's errors that is corrected."""
    largest_shift: float = 0.05
    """Largest correction of the command, m."""
    stopping_rules: StoppingRules = field(default_factory=StoppingRules)
    """When it ends."""
    contact: apex_estimate.ContactConfig = field(default_factory=apex_estimate.ContactConfig)
    """How contact is learnt in simulation."""

    def __post_init__(self) -> None:
        if len(set(self.commands)) < 2:
            raise UsageError(
                f"Commands {self.commands} are too few to correct by; give at least two heights."
            )
        if not 2 * len(self.commands) <= self.trial_seconds <= 60:
            raise UsageError(
                f"A trial of {self.trial_seconds:g} s does not suit {len(self.commands)} commands;"
                f" give {2 * len(self.commands)} to 60 s."
            )
        if not 0 < self.stopping_rules.minutes <= 600:
            raise UsageError(
                f"'minutes' is {self.stopping_rules.minutes:g} but must lie in 0 to 600."
            )

    @property
    def schedule(self) -> CommandSchedule:
        """The heights of a trial, each for as long."""
        each = self.trial_seconds / len(self.commands)
        return CommandSchedule(tuple((command, each) for command in self.commands))


@dataclass(frozen=True)
class Task:
    """What goes on learning."""

    policy: Policy
    """The one to go on from."""
    robot: Robot
    """The believed leg."""
    seed: int
    """Seed of everything."""


class Finetuning:
    """One continued training, see ``finetune``; ``rows`` are the trials so far."""

    def __init__(
        self,
        task: Task,
        robot: hardware_trial.TrialRobot,
        options: FinetuneConfig,
        folder: Path,
        pretraining: Path | None = None,
        on_trial: Callable[[Row], None] = lambda _: None,
    ) -> None:
        if task.policy.for_any_leg:
            raise UsageError(
                f"{task.policy.name} is for any leg and corrects its command itself, from hop to"
                " hop; continue a policy that was trained on one leg."
            )
        self._task, self._robot, self._options, self._folder = task, robot, options, folder
        self._on_trial = on_trial
        self._estimator = apex_estimate.prepare(
            task.policy, task.robot, options.contact, pretraining or folder / "pretraining"
        )
        self._file = folder / "trials" / "rows.json"
        self.rows: list[Row] = []
        if self._file.exists():
            self.rows = run_folder.read_json(self._file)["rows"]

    def run(self) -> tuple[bytes, str]:
        """Go on until a rule ends it; return the best policy's file and why it ended."""
        while not (reason := self._reason()):
            number = len(self.rows)
            policy = Policy(self._content(self._shifts), "the policy in training", "policy")
            seed = int(np.random.SeedSequence((self._task.seed, number)).generate_state(1)[0])
            trial = self._robot.hop(policy, self._options.schedule, seed)
            trial.trace.save(self._folder / "trials" / f"{number:04d}.parquet")
            self.rows.append(self._judged(trial))
            write_json(self._file, {"rows": self.rows})
            self._on_trial(self.rows[-1])
        best = min(self.rows, key=lambda row: float(row["error_m"]), default=None)
        return self._content(best["shifts_m"] if best else self._shifts), reason

    @property
    def minutes(self) -> float:
        """Robot time so far."""
        return float(self.rows[-1]["minutes"]) if self.rows else 0.0

    @property
    def _shifts(self) -> list[float]:
        """What the next trial adds to the command at each height, m."""
        return self.rows[-1]["next_shifts_m"] if self.rows else [0.0] * len(self._options.commands)

    def _reason(self) -> str:
        errors, o = [row["error_m"] for row in self.rows], self._options
        return o.stopping_rules.reason(errors, self.minutes, o.trial_seconds / 60)

    def _judged(self, trial: hardware_trial.HardwareTrial) -> Row:
        """Return the row of a trial, with what follows from it."""
        o, shifts = self._options, self._shifts
        apexes = estimated(trial, self._estimator(TrialData.of([trial.trace]))[0])
        judged = score(apexes, o.schedule, trial.complaint)
        row: Row = {
            "trial": len(self.rows),
            "minutes": self.minutes + trial.seconds / 60,
            "complaint": trial.complaint,
            "shifts_m": list(shifts),
            **_numbers(judged, ""),
        }
        if trial.truth is not None:
            row |= _numbers(score(trial.truth, o.schedule, trial.complaint), "true_")
        best = min([*self.rows, row], key=lambda row: float(row["error_m"]))
        row["rolled_back"] = best is not row and (
            bool(trial.complaint) or o.stopping_rules.rolled_back(self._errors_since(row))
        )
        row["next_shifts_m"] = list(best["shifts_m"])
        if not row["rolled_back"]:
            errors = np.array([judged.offsets[c] if judged.hops_at[c] else 0.0 for c in o.commands])
            wanted: Array = np.array(shifts) - o.rate * errors
            row["next_shifts_m"] = wanted.clip(-o.largest_shift, o.largest_shift).tolist()
        return row

    def _errors_since(self, row: Row) -> list[float]:
        """Return the best error and those of the trials since a policy was rolled back, m."""
        rows = [*self.rows, row]
        rolled_back = [index for index, row in enumerate(self.rows) if row["rolled_back"]]
        first = rolled_back[-1] + 1 if rolled_back else 0
        return [min(r["error_m"] for r in rows), *(r["error_m"] for r in rows[first:])]

    def _content(self, shifts: Sequence[float]) -> bytes:
        policy = self._task.policy
        card = replace(
            policy.card,
            recipe=f"{policy.card.recipe}, continued from {policy.digest}",
            seed=self._task.seed,
            steps=policy.card.steps + round(60 * self.minutes * policy.card.rate),
        )
        command_map = onnx_export.CommandMap(self._options.commands, tuple(shifts))
        return onnx_export.with_card(
            onnx_export.with_command_map(policy.content, command_map), card
        )


def _numbers(judged: Score, prefix: str) -> Row:
    return {
        f"{prefix}error_m": judged.error,
        f"{prefix}hops": judged.hops,
        f"{prefix}by_command": [
            {"command_m": c, "median_abs_error_m": error, "median_error_m": judged.offsets[c]}
            for c, error in judged.by_command.items()
        ],
    }


def finetune(
    task: Task,
    robot: hardware_trial.TrialRobot,
    options: FinetuneConfig,
    out: Path,
    *,
    resume: bool = False,
    pretraining: Path | None = None,
    on_trial: Callable[[Row], None] = lambda _: None,
) -> dict[str, Any]:
    """Continue a policy's training and leave policy, card and numbers in a folder.

    ``pretraining`` is the folder of what is learnt beforehand, if others share it. Returns the
    content of ``finetune.json``; raises ``UsageError`` where ``out`` holds a run that cannot be
    continued so.
    """
    asked = run_folder.as_stored(
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
    with hold_folder(out, UsageError):
        if run_folder.is_new(out, resume=resume):
            write_json(out / "config.json", asked)
            run_folder.write_robot(out, task.robot)
        else:
            run_folder.check_same(out, run_folder.read_json(out / "config.json"), asked)
            run_folder.refuse_finished(out / POLICY)
        finetuning = Finetuning(task, robot, options, out, pretraining, on_trial)
        content, reason = finetuning.run()
        result = {
            **asked,
            **summary(finetuning.rows, reason),
            "versions": run_folder.library_versions(),
        }
        write_json(out / RESULT, result)
        write_atomically(out / "model_card.md", card(result).encode())
        write_atomically(out / POLICY, content)
        return result


def summary(rows: list[Row], reason: str) -> dict[str, Any]:
    """Return what a finished run comes to, as JSON values."""
    return {
        "why_it_ended": reason,
        "minutes": rows[-1]["minutes"] if rows else 0.0,
        "first_trial": rows[0] if rows else None,
        "best_trial": min(rows, key=lambda row: float(row["error_m"])) if rows else None,
        "safety": {
            "ended_early": sum(bool(row["complaint"]) for row in rows),
            "complaints": sorted({row["complaint"] for row in rows if row["complaint"]}),
            "rolled_back": sum(row["rolled_back"] for row in rows),
        },
        "trials": rows,
    }


def card(result: dict[str, Any]) -> str:
    """Return the model card of a finished run, as Markdown, from its ``finetune.json``."""
    best, first = result["best_trial"], result["first_trial"]
    lines = [
        f"# Policy `{result['policy']}`, continued on `{result['on']}`\n",
        f"Source: policy `{result['policy']}` ({result['policy_digest']}), believed robot"
        f" `{result['robot']}` ({result['robot_digest']}), seed {result['seed']}.\n",
        f"- Robot time: {result['minutes']:.1f} min in {len(result['trials'])} trials."
        f" {result['why_it_ended']}",
        f"- Ended early: {result['safety']['ended_early']}; rolled back:"
        f" {result['safety']['rolled_back']}.",
    ]
    if best:
        shifts = ", ".join(
            f"{1e3 * shift:+.1f} mm at {row['command_m']:g} m"
            for shift, row in zip(best["shifts_m"], best["by_command"], strict=True)
        )
        lines += [
            f"- Median |apex - command| as estimated from the joints: {1e3 * first['error_m']:.1f}"
            f" mm in the first trial, {1e3 * best['error_m']:.1f} mm in the best, which chose it.",
            f"- The command is shifted by {shifts}, linear between.",
        ]
    return "\n".join(lines) + "\n"
