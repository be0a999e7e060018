"""Train a recipe: learn, checkpoint, try snapshots, choose the best, write the policy."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rich.progress import TextColumn, TimeRemainingColumn

from hopping_leg import errors, io
from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.progress import LiveProgress
from hopping_leg.rl import loggers, onnx_export, policy_evaluation, resumable, run_folder
from hopping_leg.rl.checkpoint import write_checkpoint
from hopping_leg.rl.model_card import write_card
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot.parameters import Robot


class TrainingProgress(LiveProgress):
    """Live numbers of a training, as a context manager."""

    def __init__(self, title: str, *, quiet: bool = False) -> None:
        super().__init__(title, columns=(TextColumn("left"), TimeRemainingColumn()), quiet=quiet)
        self._title = title
        self._first_steps: int | None = None

    def update(self, share: float, steps: int, hops: int, error: float, best: str) -> None:
        """Show the share that is done, 0 to 1, and the latest mean |apex - command|, m."""
        if self._first_steps is None:
            self._first_steps = steps
        note = f"{hops} hops"
        if math.isfinite(error):
            note += f" · apex error {1000 * error:.0f} mm"
        if steps > self._first_steps:
            note += f" · {(steps - self._first_steps) / max(self.passed, 1e-9):.0f} steps/s"
        note += best
        self._bar.update(self._task, completed=share, note=note)
        self._line_if_due(f"{self._title} {100 * share:.0f} % · {note}")


SHOWN_EVERY = 0.5
"""Time between two updates of the progress bar, s."""


@dataclass(frozen=True)
class Trained:
    """A finished training."""

    policy: Path
    """The selected policy file, in the run's folder."""
    minutes: float
    """Wall-clock time of the training, pauses excluded."""
    steps: int
    """Control steps of experience."""


def train(
    recipe: Recipe,
    robot: Robot,
    seed: int,
    out: Path,
    *,
    resume: bool = False,
    source: Path | None = None,
    minutes: float | None = None,
    threads: int = 1,
    quiet: bool = False,
    log: loggers.Log = "tensorboard",
    on_snapshot: Callable[[int, float], None] = lambda _steps, _score: None,
    on_early_score: Callable[[float, float], None] | None = None,
) -> Trained:
    """Train a controller, scaled to the robot's size; leave policy, card and history in ``out``.

    A run that was killed at any moment continues with ``resume`` as if nothing had happened; with
    ``minutes`` that holds up to the clock, which the learning rate then follows.

    Args:
        recipe: What to train.
        robot: The leg.
        seed: Seed of weights, exploration, task, noise and delay.
        out: The run's folder.
        resume: Go on with the run in ``out``; without one, begin.
        source: Folder of another run of this recipe and robot; its newest checkpoint is the start,
            its steps and time count, its snapshots do not.
        minutes: Stop after so much wall-clock time, pauses excluded, or at the recipe's steps.
        threads: Threads of torch and physics; torch's is set for the whole process.
        quiet: Show no progress.
        log: Who gets the curves besides TensorBoard.
        on_snapshot: Called with steps and score, m, of every snapshot; may raise to end it.
        on_early_score: Called once, as soon as the recipe can tell how bad the training is likely
            to end, with that in m and the minutes so far, after a checkpoint; may raise to end it.

    Raises:
        UsageError: ``out`` holds a run that cannot be continued so, or ``log`` lacks a package.
        RobotError: The robot has effects that training does not simulate.
    """
    check(robot, minutes, log)
    torch.set_num_threads(max(threads, 1))
    recipe = recipe.fit(robot)
    folder = run_folder.RunFolder(out, recipe, robot, seed, minutes, source)
    tree = folder.begin(resume=resume)
    trainer = Trainer(recipe, robot, seed, folder, minutes, threads)
    trainer.model.set_logger(loggers.make_logger(folder.path, log, folder.config))
    trainer.on_snapshot, trainer.on_early_score = on_snapshot, on_early_score
    if tree is not None:
        trainer.restore(tree)
    with TrainingProgress(f"{recipe.name} seed {seed}", quiet=quiet) as progress:
        return trainer.run(progress)


def check(robot: Robot, minutes: float | None, log: loggers.Log) -> None:
    """Refuse what cannot be trained before anything is written, raising as ``train`` does."""
    loggers.check_log(log)
    if minutes is not None and not 0 < minutes < float("inf"):
        raise errors.UsageError(f"--minutes is {minutes:g} but must be positive.")
    if not robot.reality.only_delays:
        raise errors.RobotError(
            f"{robot.name} has effects in [reality] that training does not know; train on what is"
            " believed of it, the robot that its file extends or one from `hop identify`, and"
            " judge the policy on it with `hop evaluate`."
        )


class Trainer:
    """One training in one process."""

    def __init__(
        self,
        recipe: Recipe,
        robot: Robot,
        seed: int,
        folder: run_folder.RunFolder,
        minutes: float | None,
        threads: int,
    ) -> None:
        self.recipe, self.robot, self.seed, self.folder = recipe, robot, seed, folder
        self._seconds = float("inf") if minutes is None else 60 * minutes
        self.env = recipe.make_env(robot, seed, threads)
        self.model = recipe.make_model(self.env, seed)
        self.model.on_boundary = self._at_boundary
        if minutes is not None:
            self.model.remaining = lambda: max(0.0, 1 - self.elapsed / self._seconds)
        self.selection = Selection(recipe, robot, folder)
        self._restored = False
        self._earlier = 0.0
        self._began = self._saved = time.monotonic()
        self._shown = 0.0
        self._progress: TrainingProgress | None = None
        self.on_snapshot: Callable[[int, float], None] = lambda _steps, _score: None
        self.on_early_score: Callable[[float, float], None] | None = None

    @property
    def elapsed(self) -> float:
        """Wall-clock time of the training, pauses excluded, s."""
        return self._earlier + time.monotonic() - self._began

    def restore(self, tree: dict[str, Any]) -> None:
        """Go on from a checkpoint, of this run or of the shorter one that it begins with."""
        resumable.restore(self.model, tree["model"])
        self.selection.rows = tree["history"]
        self._earlier = tree["elapsed"]
        self._restored = True
        self._began = time.monotonic()
        done = self.model.num_timesteps
        self.model._update_current_progress_remaining(done, self.recipe.schedule.steps)

    def run(self, progress: TrainingProgress) -> Trained:
        """Learn until steps or time are used up; write the selected policy."""
        self._progress = progress
        model, recipe = self.model, self.recipe
        if self.elapsed < self._seconds and model.num_timesteps < recipe.schedule.steps:
            model.learn(
                recipe.schedule.steps - model.num_timesteps,
                callback=lambda *_: self.tick(),
                log_interval=recipe.schedule.log_every,
                reset_num_timesteps=not self._restored,
            )
        self._evaluate()
        model.logger.close()
        self._show(force=True)
        content, results = self.selection.choose()
        minutes, steps = self.elapsed / 60, int(model.num_timesteps)
        result = {
            "command": self.folder.command,
            "minutes": minutes,
            "steps": steps,
            "selected": results,
            "history": self.selection.rows,
            **recipe.extra_results(model),
        }
        self.folder.write("result.json", {**self.folder.config, **result})
        write_card(self.folder.path)
        io.write_atomically(self.folder.policy, content)
        return Trained(self.folder.policy, minutes, steps)

    def tick(self) -> bool:
        """Show the progress; return whether there is time left."""
        self._show()
        return self.elapsed < self._seconds

    def _at_boundary(self) -> None:
        share = 1 - self.model._current_progress_remaining
        for name, mean in self.env.take_reward_terms().items():
            self.model.logger.record_mean(f"reward/{name}", mean)
        self.recipe.anneal(self.model, self.env, share)
        self._tell_early_score()
        due = self.model.num_timesteps >= self.selection.next_at
        if due and share >= self.recipe.selection.eval_start:
            self._evaluate()
        if time.monotonic() - self._saved >= self.recipe.schedule.checkpoint_seconds:
            self.checkpoint()

    def _tell_early_score(self) -> None:
        early_score, tell = self.recipe.early_score(self.model), self.on_early_score
        if early_score is not None and tell is not None:
            self.on_early_score = None
            self.checkpoint()
            tell(early_score, self.elapsed / 60)

    def checkpoint(self) -> None:
        """Write a checkpoint; only at a boundary does it continue exactly."""
        tree = {
            "model": resumable.state_of(self.model),
            "history": self.selection.rows,
            "elapsed": self.elapsed,
        }
        write_checkpoint(self.folder.checkpoints, self.model.num_timesteps, tree)
        self._saved = time.monotonic()

    def policy_content(self) -> bytes:
        """Return the deterministic policy as it stands, as a policy file."""
        recipe, robot = self.recipe, self.robot
        low, high = recipe.task.command_bounds
        hip, knee = recipe.task.action_torque
        card = Card(
            recipe=recipe.name,
            layout=recipe.task.observation,
            command_low=low,
            command_high=high,
            torque_scale=(float(hip), float(knee)),
            robot=robot.name,
            robot_digest=robot.digest,
            rate=recipe.task.rate,
            seed=self.seed,
            steps=int(self.model.num_timesteps),
            versions=self.folder.config["versions"],
        )
        return onnx_export.build_policy(recipe.actor(self.model, self.env), card)

    def _evaluate(self) -> None:
        steps = int(self.model.num_timesteps)
        content = self.policy_content()
        row = self.selection.add(steps, self.elapsed / 60, content)
        logger = self.model.logger
        logger.record("trial/score_m", row["score_m"])
        for trial in row["trials"]:
            at = f"trial/{trial['command_m']:.2f}"
            for name in ("median_error_m", "std_m", "hops_per_s", "skipped_hops"):
                if trial[name] is not None:
                    logger.record(f"{at}/{name}", trial[name])
        logger.dump(steps)
        self.on_snapshot(steps, row["score_m"])

    def _show(self, *, force: bool = False) -> None:
        now = time.monotonic()
        if self._progress is None or (now - self._shown < SHOWN_EVERY and not force):
            return
        self._shown = now
        steps = int(self.model.num_timesteps)
        share = max(steps / self.recipe.schedule.steps, self.elapsed / self._seconds)
        self._progress.update(
            min(share, 1.0), steps, self.env.hops, self.env.apex_error, self.selection.describe()
        )


FINALISTS = 4
"""Snapshots that are tried once more at the end."""


class Selection:
    """Tries every snapshot on one seed; the best few again on others, and one of those wins."""

    def __init__(self, recipe: Recipe, robot: Robot, folder: run_folder.RunFolder) -> None:
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
        row = {
            "steps": steps,
            "minutes": minutes,
            **self._trials(content, (policy_evaluation.FIRST_SEED,)),
        }
        self.rows.append(row)
        return row

    def choose(self) -> tuple[bytes, dict[str, Any]]:
        """Return the best policy file and its row, with the scores of all finalists."""
        ranked = sorted(self.rows, key=lambda row: float(row["score_m"]))[:FINALISTS]
        finals = []
        for row in ranked:
            content = self._folder.snapshot(row["steps"]).read_bytes()
            again = self._trials(content, policy_evaluation.FINAL_SEEDS)
            finals.append(({"steps": row["steps"], "minutes": row["minutes"], **again}, content))
        best, content = min(finals, key=lambda final: float(final[0]["score_m"]))
        scores = [{"steps": row["steps"], "score_m": row["score_m"]} for row, _ in finals]
        return content, {**best, "finalists": scores, "seeds": list(policy_evaluation.FINAL_SEEDS)}

    def describe(self) -> str:
        """Return what to show of the best snapshot so far, or nothing."""
        if not self.rows:
            return ""
        best = min(self.rows, key=lambda row: float(row["score_m"]))
        return f" · best snapshot {1000 * best['score_m']:.0f} mm"

    def _trials(self, content: bytes, seeds: tuple[int, ...]) -> dict[str, Any]:
        recipe = self._recipe
        policy = Policy(content, "snapshot", recipe.name)
        results = policy_evaluation.evaluate_policy(
            policy, self._robot, recipe.selection.eval_commands, seeds, recipe.task.rate
        )
        return {
            "score_m": policy_evaluation.score(results),
            "trials": policy_evaluation.as_rows(results),
        }
