"""Trials turned into recorded runs."""

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hopping_leg.controllers import Controller, RolloutConfig, rollout
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate.trials import Trial
from hopping_leg.io import safe_file_name
from hopping_leg.robot.model_mismatch import Ground
from hopping_leg.robot.parameters import Contact, Robot
from hopping_leg.trace import Trace

FLOORS = {"soft": "the robot's own contact", "stiff": "MuJoCo's default contact, solref 0.02 1"}
"""Grounds to be judged on; in PyBullet the stiff one is its own rigid contact."""

Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""


@dataclass(frozen=True)
class Run:
    """One trial with one realisation of noise and delay.

    Attributes:
        controller: As named on the command line.
        trial: What was commanded.
        repeat: Number of the realisation, from 0.
        trace: What happened.
    """

    controller: str
    trial: Trial
    repeat: int
    trace: Trace

    @property
    def file_name(self) -> str:
        """Name of the run's trace file, unique within an evaluation."""
        return f"{safe_file_name(self.controller)}-{self.trial.name}-{self.repeat}.parquet"


def floor_robot(robot: Robot, floor: str) -> Robot:
    """Return the robot on another floor.

    Raises:
        UsageError: There is no such floor.
    """
    if floor not in FLOORS:
        raise UsageError(unknown_name("floor", floor, FLOORS))
    if floor == "soft":
        return robot
    reality = replace(robot.reality, ground=Ground())
    return replace(robot, contact=Contact(0.02, 1.0, robot.contact.friction), reality=reality)


def on_floor(setup: RolloutConfig, floor: str) -> RolloutConfig:
    """Return the world with another floor.

    Raises:
        UsageError: There is no such floor.
    """
    if floor == "stiff" and setup.engine == "pybullet":
        return replace(setup, ground="rigid")
    return replace(setup, robot=floor_robot(setup.robot, floor))


def run_trials(
    label: str,
    controller: Controller,
    setup: RolloutConfig,
    trials: Sequence[Trial],
    *,
    repeats: int,
    seed: int,
    on_progress: Progress = lambda _: None,
) -> list[Run]:
    """Record all trials of one controller; those of equal length run as one batch.

    Args:
        label: The controller's name in tables and traces.
        controller: Controls all legs of a batch at once.
        setup: The world.
        trials: What is commanded.
        repeats: Realisations of noise and delay per trial.
        seed: All of them follow from it.
        on_progress: Called with the share done.
    """
    batches = [
        list(group) for _, group in itertools.groupby(sorted(trials, key=_seconds), key=_seconds)
    ]
    total = sum(len(b) * b[0].seconds for b in batches)
    done = 0.0
    runs: list[Run] = []
    for batch in batches:
        share = len(batch) * batch[0].seconds / total
        tick = functools.partial(_report, on_progress, done, share)
        runs += _run_batch(label, controller, setup, batch, repeats, seed, tick)
        done += share
    order = {trial.name: i for i, trial in enumerate(trials)}
    return sorted(runs, key=lambda run: (order[run.trial.name], run.repeat))


def _seconds(trial: Trial) -> float:
    return trial.seconds


def _report(on_progress: Progress, done: float, share: float, tick: int, ticks: int) -> None:
    on_progress(done + share * tick / ticks)


def _run_batch(
    label: str,
    controller: Controller,
    setup: RolloutConfig,
    trials: list[Trial],
    repeats: int,
    seed: int,
    on_tick: Callable[[int, int], None],
) -> list[Run]:
    legs = [(trial, repeat) for trial in trials for repeat in range(repeats)]
    commands = np.stack([trial.commands(setup.rate) for trial, _ in legs], axis=1)
    noise = np.random.SeedSequence([seed, round(1000 * trials[0].seconds)]).generate_state(1)
    record = rollout(controller, setup, commands, int(noise[0]), on_tick)
    return [
        Run(
            label,
            trial,
            repeat,
            record.trace(
                leg, controller=label, trial=trial.name, kind=trial.kind, repeat=repeat, seed=seed
            ),
        )
        for leg, (trial, repeat) in enumerate(legs)
    ]


def save_traces(runs: Sequence[Run], directory: Path) -> list[Path]:
    """Write the trace of every run; return the files."""
    paths = [directory / run.file_name for run in runs]
    for run, path in zip(runs, paths, strict=True):
        run.trace.save(path)
    return paths
