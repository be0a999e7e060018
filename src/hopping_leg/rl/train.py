"""Train a recipe: learn, checkpoint, try snapshots, choose the best, write the policy."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.logger import configure

from hopping_leg import errors, locks
from hopping_leg.controllers.policy import Policy
from hopping_leg.envs import TaskLeg
from hopping_leg.io import write_atomically, write_json
from hopping_leg.rl import onnx_export, reach, run_folder
from hopping_leg.rl.checkpoint import write_checkpoint
from hopping_leg.rl.policy_evaluation import FINAL_SEEDS, Selection, calibrate, input_range
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot.parameters import Robot
from hopping_leg.terminal import Progress

_RANGE_LEGS, _RANGE_STRIDE = 24, 5
"""Legs of any size whose hops tell a policy's range of inputs, and which of their heights do."""


def train(
    recipe: Recipe,
    robot: Robot,
    seed: int,
    out: Path,
    *,
    resume: bool = False,
    minutes: float | None = None,
    threads: int = 1,
    quiet: bool = False,
    ray: str | None = None,
    command: str = "hopping_leg.rl.train",
) -> Path:
    """Train a controller, scaled to the robot's size; return the policy's file.

    Beside it in ``out`` are its card and history, see ``run_folder.read_result``.

    A run that was killed at any moment continues with ``resume`` as if nothing had happened; with
    ``minutes`` that holds up to the clock, which the learning rate then follows.

    Args:
        recipe: What to train.
        robot: The leg.
        seed: Seed of weights, exploration, task, noise and delay.
        out: The run's folder.
        resume: Go on with the run in ``out``; without one, begin.
        minutes: Stop so long after the first rollout, pauses excluded, or at the recipe's steps.
        threads: Threads of torch and physics; torch's is set for the whole process.
        quiet: Show no progress.
        ray: Address of a Ray cluster that collects the rollouts of all workers but the first, and
            finds out what the teacher reaches on legs of any size; without one, processes of this
            machine do the latter, as many as ``threads``, at least two.
        command: What to call what made the policy, in its model card.

    Raises:
        UsageError: ``out`` holds a run that cannot be continued so, or workers do not fit.
        RobotError: The robot has effects that training does not simulate.
    """
    if minutes is not None and not 0 < minutes < float("inf"):
        raise errors.UsageError(f"--minutes is {minutes:g} but must be positive.")
    if robot.reality != robot.reality.in_training:
        raise errors.RobotError(
            f"{robot.name} has effects in [reality] beyond transmissions and their losses, delay"
            " and jitter, which training does not know; train on what is believed of it, the robot"
            " that its file extends or one from `hop identify`, and judge with `hop evaluate`."
        )
    recipe.check_workers(ray)
    began = time.monotonic()
    torch.set_num_threads(max(threads, 1))
    title = f"{recipe.name} seed {seed}"
    with Progress(f"{title}, preparing", quiet=quiet) as progress:
        fitted = recipe.fit(robot)
        folder = run_folder.RunFolder(out, fitted, robot, seed, minutes)
        if not (new := run_folder.is_new(out, resume=resume)):  # before there is a lock in it
            folder.check_same()  # before the teacher takes its time
        recipe = reach.within_reach(fitted, robot)
        with locks.hold_folder(out, errors.UsageError):
            tree = folder.begin(new=new)
            legs = reach.find_legs(
                fitted, seed, out / "legs.json", max(threads, 2), ray,
                lambda share: progress.show(title, share, about=", trying legs"),
            )  # fmt: skip
            trainer = Trainer(recipe, robot, folder, legs, progress, threads, began, ray)
            trainer.learner.set_logger(configure(str(out / "tensorboard"), ["tensorboard"]))
            if tree is not None:
                trainer.restore(tree)
            return trainer.run(command)


class Trainer:
    """One training."""

    def __init__(
        self, recipe: Recipe, robot: Robot, folder: run_folder.RunFolder, legs: Sequence[TaskLeg],
        progress: Progress, threads: int, began: float, ray: str | None,
    ) -> None:  # fmt: skip
        self.recipe, self.robot, self.folder, self.legs = recipe, robot, folder, legs
        seed, minutes = folder.config["seed"], folder.config["minutes_budget"]
        self._seconds = math.inf if minutes is None else 60 * minutes
        self.learner = recipe.make_learner(robot, seed, threads, legs, ray)
        self.learner.on_boundary = self._at_boundary
        if minutes is not None:
            self.learner.remaining = lambda: max(0.0, 1 - self._spent)
        self.selection = Selection(recipe, robot, folder.path / "snapshots")
        self.seconds: dict[str, float] = {"before the first rollout": time.monotonic() - began}
        """Time spent on each part beside the learner's, pauses excluded, s."""
        self._earlier, self._began, self._saved = 0.0, began, time.monotonic()
        self._prepared = 0.0
        self._progress, self._title = progress, f"{recipe.name} seed {seed}"

    @property
    def elapsed(self) -> float:
        """Wall-clock time of the training, pauses excluded, s."""
        return self._earlier + time.monotonic() - self._began

    @property
    def _spent(self) -> float:
        """Share of the asked time that is spent; what comes before the first rollout is not."""
        return (self.elapsed - self._prepared) / self._seconds

    def restore(self, tree: dict[str, Any]) -> None:
        """Go on from a checkpoint; UsageError says that another version wrote it."""
        try:
            self.learner.restore(tree["learner"])
            self.selection.rows, self._earlier = tree["history"], float(tree["elapsed"])
            self._prepared = float(tree["prepared"])
            parts = zip((self.seconds, self.learner.seconds), tree["seconds"], strict=True)
            for now, before in parts:
                now.update({part: now.get(part, 0.0) + before[part] for part in before})
        except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
            raise errors.UsageError(
                f"{self.folder.path} was begun by another version; train anew in another folder."
            ) from error
        self._began = time.monotonic()

    def run(self, command: str) -> Path:
        """Learn until steps or time are used up; write the selected policy."""
        learner, schedule = self.learner, self.recipe.schedule
        if self.tick() and learner.num_timesteps < schedule.steps:
            learner.train_until(schedule.steps, self.tick, schedule.log_every)
        self._evaluate()
        learner.logger.close()
        self._progress.show(self._title, 1.0, about=", selecting and calibrating")
        with self._timed("selection and calibration"):
            content, selected = self._finish()
        result = {
            **self.folder.config,
            "command": command,
            "command_bounds": self.recipe.task.command_bounds,
            "minutes": self.elapsed / 60,
            "steps": int(learner.num_timesteps),
            "selected": selected,
            "history": self.selection.rows,
            "seconds": self.seconds | learner.seconds,
        }
        write_json(self.folder.path / "result.json", result)
        write_atomically(self.folder.path / "model_card.md", run_folder.model_card(result).encode())
        Policy(content, "the selected policy", self.recipe.name).save(self.folder.policy)
        return self.folder.policy

    def _finish(self) -> tuple[bytes, dict[str, Any]]:
        """Return the selected policy, calibrated, and how it hops, as JSON values."""
        recipe = self.recipe
        content, selected = self.selection.choose()
        if recipe.selection.calibrations:
            content = calibrate(content, self.robot, recipe.selection.calibrations)
            selected |= self.selection.trials(content, FINAL_SEEDS)
        policy = Policy(content, "the selected policy", recipe.name)
        heights, legs = onnx_export.every_centimetre(recipe.task.command_bounds), [self.robot]
        if self.legs:
            legs += [leg.true for leg in self.legs[:_RANGE_LEGS]]
            heights = heights[::_RANGE_STRIDE]
        ranges = [input_range(policy, leg, heights, recipe.task.rate) for leg in legs]
        low = tuple(map(min, zip(*(least for least, _ in ranges), strict=True)))
        high = tuple(map(max, zip(*(most for _, most in ranges), strict=True)))
        limits = run_folder.known_limits(selected["trials"], bool(self.legs))
        card = replace(policy.card, input_low=low, input_high=high, known_limits=limits)
        return onnx_export.with_card(content, card), selected

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        began = time.monotonic()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.monotonic() - began

    def tick(self) -> bool:
        """Return whether there is time left."""
        if not self.learner.num_timesteps:
            self._prepared = self.elapsed
        return self._spent < 1

    def _at_boundary(self) -> None:
        self._show()
        due = self.learner.num_timesteps >= self.selection.next_at
        if due and self.learner.share >= self.recipe.selection.eval_start:
            self._evaluate()
        if time.monotonic() - self._saved >= self.recipe.schedule.checkpoint_seconds:
            self.checkpoint()

    def checkpoint(self) -> None:
        """Write a checkpoint; only at a boundary does it continue exactly."""
        tree = {
            "learner": self.learner.state(),
            "history": self.selection.rows,
            "elapsed": self.elapsed,
            "prepared": self._prepared,
            "seconds": (self.seconds, self.learner.seconds),
        }
        write_checkpoint(self.folder.checkpoints, self.learner.num_timesteps, tree)
        self._saved = time.monotonic()

    def _evaluate(self) -> None:
        learner, steps = self.learner, int(self.learner.num_timesteps)
        with self._timed("snapshots"):
            card = onnx_export.make_card(
                self.robot, self.recipe.task, self.recipe.name,
                seed=self.folder.config["seed"], steps=steps,
                versions=self.folder.config["versions"],
            )  # fmt: skip
            content = onnx_export.build_policy(learner.network(), learner.task.observation, card)
            row = self.selection.add(steps, self.elapsed / 60, content)
        logger = learner.logger
        logger.record("trial/score_m", row["score_m"])
        for trial in row["trials"]:
            at = f"trial/{trial['command_m']:.2f}"
            for name in ("median_error_m", "std_m", "hops_per_s", "skipped_hops"):
                if trial[name] is not None:
                    logger.record(f"{at}/{name}", trial[name])
        logger.dump(steps)

    def _show(self) -> None:
        steps, error = int(self.learner.num_timesteps), self.learner.task.mean_apex_error
        share = max(steps / self.recipe.schedule.steps, self._spent)
        notes = [f"{steps / self.elapsed:.0f} steps/s"]
        if math.isfinite(error):
            notes.append(f"apex error {1000 * error:.0f} mm")
        if self.selection.rows:
            best = min(float(row["score_m"]) for row in self.selection.rows)
            notes.append(f"best snapshot {1000 * best:.0f} mm")
        self._progress.show(self._title, min(share, 1.0), " · ".join(notes))
