"""The robustness benchmark: every controller on every axis, in worlds that it was not told of.

All trials of an axis are fixed by the seed before any controller has moved, and run as one batch.
"""

import functools
import itertools
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from scipy.stats import qmc

from hopping_leg.arrays import Array
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.rollout import Perturbation
from hopping_leg.evaluate import metrics, runner, statistics
from hopping_leg.evaluate.robustness_axes import AXES, NOMINAL, Axis, Case
from hopping_leg.evaluate.runner import Entry, check_entries

SCHEMA = 2  # Version of the JSON, raised when a name changes its meaning
TOLERANCE = 0.02  # Largest magnitude of the median apex minus the command in a successful trial, m
JOINT_POINTS = 4  # Points of the hypercube per command and seed
PUSH_SECONDS = 0.02  # Duration of each push, s

GROUND_SECONDS, SWITCH_SECONDS = 1.0, 2.5
"""Time between two steps of the ground, and of the command, s."""


@dataclass(frozen=True)
class Suite:
    """What is run."""

    setup: RolloutConfig
    """What controllers believe, with the paper's noise and delay."""
    commands: tuple[float, ...]
    """Desired apex heights, m."""
    axes: tuple[Axis, ...]
    repeats: int = 5
    """Realisations of noise, delay and perturbation per level and command."""
    seed: int = 1000
    """All randomness follows from it."""
    seconds: float = 10.0
    """Duration of each trial, s."""


def run_suite(
    entries: Sequence[Entry],
    suite: Suite,
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> dict[str, Any]:
    """Let every controller meet every axis; return ``scores``, ``levels`` and more, for JSON."""
    check_entries(entries, suite.commands)
    parts = (NOMINAL, *suite.axes)
    scores: list[dict[str, Any]] = []
    levels: list[dict[str, Any]] = []
    for entry in entries:
        met: dict[str, pl.DataFrame] = {}
        for number, axis in enumerate(parts):

            def tick(done: int, ticks: int, label: str = entry.label, number: int = number) -> None:
                on_progress(label, (number + done / ticks) / len(parts))

            plan = make_trials(axis, suite)
            run = rollout(
                entry.controller, suite.setup, plan.commands, plan.seed, tick, plan.perturbation
            )
            met[axis.name] = pl.DataFrame(
                [outcome(c, metrics.measure(run.trace(leg))) for leg, c in enumerate(plan.cases)]
            )
            levels += level_rows(entry.label, axis.name, met[axis.name])
        del met[NOMINAL.name]
        scores += score_rows(entry.label, met, suite.seed)
    return {
        "schema": SCHEMA,
        "scores": scores,
        "levels": levels,
        "axes": [{k: v for k, v in vars(axis).items() if k != "alter"} for axis in suite.axes],
        "conditions": {
            **runner.setup_conditions(suite.setup),
            "commands_m": suite.commands,
            "seeds": suite.repeats,
            "seed": suite.seed,
            "seconds": suite.seconds,
            "joint_points": JOINT_POINTS,
            "tolerance_m": TOLERANCE,
        },
        "versions": runner.software_versions(),
        "notes": [note for entry in entries for note in entry.notes],
    }


@dataclass(frozen=True)
class AxisTrials:
    """All trials of an axis, run as one batch."""

    cases: tuple[Case, ...]
    """n of them."""
    commands: Array
    """Desired heights, m, (ticks, n)."""
    perturbation: Perturbation
    """What changes and pushes the legs."""
    seed: int
    """Seed of noise and delay."""


def make_trials(axis: Axis, suite: Suite) -> AxisTrials:
    """Lay down all trials of an axis: every realisation of each of its levels and commands."""
    entropy, robot = [suite.seed, zlib.crc32(axis.name.encode())], suite.setup.robot
    points = 1 if axis.alter else JOINT_POINTS
    each = list(itertools.product(suite.commands, range(suite.repeats), range(points)))
    if axis.alter:
        changes = [axis.alter] * len(each)
    else:  # the hypercube is drawn once; a level is a share of the way from neutral to its points
        cube = qmc.LatinHypercube(len(AXES), rng=np.random.default_rng(entropy))
        changes = [functools.partial(_change_all, row) for row in cube.random(len(each))]
    cases = tuple(
        change(Case(robot, level, *one), level)
        for level in axis.levels
        for one, change in zip(each, changes, strict=True)
    )
    command, torque, force, ground = (
        np.stack(events, axis=1)
        for events in zip(*(_events(case, suite) for case in cases), strict=True)
    )
    return AxisTrials(
        cases,
        command,
        Perturbation(tuple(case.robot for case in cases), torque, force, ground),
        int(np.random.SeedSequence(entropy).generate_state(1)[0]),
    )


def _change_all(point: Array, case: Case, share: float) -> Case:
    """Change every axis by a share of the way to its place, 0 to 1, in its moderate range."""
    for axis, place in zip(AXES, point, strict=True):
        assert axis.alter
        low, high = axis.moderate
        value = low + place * (high - low)
        case = axis.alter(case, float(axis.neutral + share * (value - axis.neutral)))
    return case


def _events(case: Case, suite: Suite) -> tuple[Array, Array, Array, Array]:
    """Return command, torques, force on the base and ground of a trial over time.

    Draws depend on seed, command, repeat and point alone, so that levels differ in size only.
    """
    rng = np.random.default_rng([suite.seed, case.repeat, case.point, round(1e4 * case.command)])
    rate = suite.setup.rate
    time = np.arange(round(suite.seconds * rate)) / rate
    torque = case.torque_noise * rng.standard_normal((len(time), 2))
    pushes = np.zeros(len(time))  # with the sign, once in each second but the first
    length = max(1, round(PUSH_SECONDS * rate))
    for whole in range(1, round(len(time) / rate)):
        start = round((whole + rng.uniform(0, 1 - PUSH_SECONDS)) * rate)
        pushes[start : start + length] = rng.choice((-1.0, 1.0))
    force = case.push / PUSH_SECONDS * pushes
    at = np.floor(time / GROUND_SECONDS).astype(int)
    ground = case.ground * rng.choice((-1, 1)) * np.array([0, 1, 0, -1])[at % 4]
    # The command steps away and back, within the suite's heights.
    low, high = min(suite.commands), max(suite.commands)
    share = (case.command - low) / (high - low) if high > low else 0.5
    bottom = case.command - share * case.command_step
    pair = (bottom, bottom + case.command_step)
    first, second = pair if share <= 0.5 else pair[::-1]
    command = np.where(np.floor(time / SWITCH_SECONDS) % 2 == 0, first, second)
    return command, torque, force, ground


def outcome(case: Case, windows: Sequence[metrics.HopWindow]) -> dict[str, Any]:
    """Return how a trial went, given its stretches of constant command.

    Its error is the median apex minus command; where the command steps, of the height that is
    missed most. A height without a hop is missed by standing height minus command. A trial is a
    success where no hop was skipped and the error is within ``TOLERANCE``.
    """
    groups = [[w for w in windows if w.command == c] for c in {w.command for w in windows}]
    errors = [float(np.median(np.concatenate(metrics.errors_of(group)))) for group in groups]
    error, skipped = max(errors, key=abs), sum(w.skipped for w in windows)
    missed = any(not len(metrics.pooled_apexes(group)) for group in groups)
    return {
        "level": case.level,
        "command_m": case.command,
        "repeat": case.repeat,
        "error_m": error,
        "missed": missed,
        "skipped": skipped,
        "contacts": sum(w.contacts("base") + w.contacts("knee") for w in windows),
        "success": skipped == 0 and not missed and abs(error) <= TOLERANCE,
    }


def level_rows(controller: str, axis: str, outcomes: pl.DataFrame) -> list[dict[str, Any]]:
    """Return the results of each level of an axis, by rising level."""
    levels = outcomes.group_by("level").agg(
        pl.col("success").mean(),
        median_abs_error_m=pl.col("error_m").abs().median(),
        missed=pl.col("missed").sum(),
        skipped_hops=pl.col("skipped").sum(),
        body_contacts=pl.col("contacts").sum(),
        trials=pl.len(),
    )
    return [
        {"controller": controller, "axis": axis, **row} for row in levels.sort("level").to_dicts()
    ]


def score_rows(
    controller: str, outcomes: dict[str, pl.DataFrame], seed: int
) -> list[dict[str, Any]]:
    """Return a controller's score on every axis, given its trials by axis, and overall.

    A score is the mean over axes of the mean over levels of the share of successes. Its 95 %
    interval is over realisations: all levels, commands and axes share their draws.
    """
    every = pl.concat([found.with_columns(axis=pl.lit(name)) for name, found in outcomes.items()])
    success, rows = pl.col("success").mean(), []
    for name in (*outcomes, "overall"):
        trials = every if name == "overall" else every.filter(axis=name)
        levels = trials.group_by("repeat", "axis", "level").agg(success)
        axes = levels.group_by("repeat", "axis").agg(success)
        scores = axes.group_by("repeat").agg(success).sort("repeat")["success"].to_numpy()
        low, high = statistics.share_interval(scores, seed)
        row = {"controller": controller, "axis": name, "score": float(scores.mean())}
        rows.append({**row, "low": low, "high": high, "trials": len(trials)})
    return rows
