"""All trials of one axis: their worlds, fixed by a seed before any controller has moved."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from hopping_leg.arrays import Array
from hopping_leg.evaluate.robustness import axes
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.perturbation import Perturbation

SECONDS = 10.0
"""Duration of each trial, s."""

JOINT_POINTS = 4
"""Points of the hypercube per command and seed."""

PUSH_SECONDS = 0.02
"""Duration of each push, s."""

GROUND_SECONDS, SWITCH_SECONDS = 1.0, 2.5
"""Time between two steps of the ground, and of the command, s."""


@dataclass(frozen=True)
class RobustnessTrial:
    """One leg of an axis' batch."""

    level: float
    """Level of the axis."""
    command: float
    """Desired apex height, m."""
    repeat: int
    """Number of the realisation, from 0."""
    point: int
    """Number of the hypercube's point, 0 elsewhere."""
    case: axes.Case
    """What is simulated."""


@dataclass(frozen=True)
class AxisTrials:
    """All trials of an axis, run as one batch."""

    trials: tuple[RobustnessTrial, ...]
    """n of them."""
    commands: Array
    """Desired heights, m, (ticks, n)."""
    perturbation: Perturbation
    """What changes and pushes the legs."""
    seed: int
    """Seed of noise and delay."""


def make_trials(
    axis: str,
    robot: Robot,
    commands: Sequence[float],
    repeats: int,
    seed: int,
    *,
    rate: float,
    levels: Sequence[float] | None = None,
    seconds: float = SECONDS,
) -> AxisTrials:
    """Lay down all trials of an axis, some realisations of each of its levels and commands, m.

    Other ``levels`` stand in for the axis' own.

    Raises:
        UsageError: There is no such axis.
    """
    entropy = [seed, zlib.crc32(axis.encode())]
    pairs = [(command, repeat) for command in commands for repeat in range(repeats)]
    if axis == axes.JOINT:
        # the hypercube is drawn once; a level is a share of the way from neutral to its points
        each = [(*pair, point) for pair in pairs for point in range(JOINT_POINTS)]
        cube = qmc.LatinHypercube(len(axes.AXES), rng=np.random.default_rng(entropy)).random(
            len(each)
        )
        trials = [
            RobustnessTrial(level, *one, _joint_case(robot, row, level))
            for level in levels or axes.JOINT_LEVELS
            for one, row in zip(each, cube, strict=True)
        ]
    else:
        cases = {0.0: axes.Case(robot)}
        if axis != axes.NOMINAL:
            found = axes.axis_named(axis)
            cases = {
                level: found.alter(axes.Case(robot), level) for level in levels or found.levels
            }
        trials = [
            RobustnessTrial(lv, *pair, 0, case) for lv, case in cases.items() for pair in pairs
        ]
    ticks, within = round(seconds * rate), (min(commands), max(commands))
    events = [_events(trial, seed, ticks, rate, within) for trial in trials]
    command, torque, force, ground = (np.stack(e, axis=1) for e in zip(*events, strict=True))
    robots = tuple(trial.case.robot for trial in trials)
    return AxisTrials(
        tuple(trials),
        command,
        Perturbation(robots, torque, force, ground),
        int(np.random.SeedSequence(entropy).generate_state(1)[0]),
    )


def _joint_case(robot: Robot, row: Array, share: float) -> axes.Case:
    case = axes.Case(robot)
    for axis, place in zip(axes.AXES, row, strict=True):
        low, high = axis.moderate
        value = low + place * (high - low)
        case = axis.alter(case, float(axis.neutral + share * (value - axis.neutral)))
    return case


def _events(
    trial: RobustnessTrial, seed: int, ticks: int, rate: float, within: tuple[float, float]
) -> tuple[Array, Array, Array, Array]:
    """Return command, torques, force on the base and ground of a trial over time.

    Draws depend on seed, command, repeat and point alone, so that levels differ in size only.
    """
    rng = np.random.default_rng([seed, trial.repeat, trial.point, round(1e4 * trial.command)])
    case, time = trial.case, np.arange(ticks) / rate
    torque = case.torque_noise * rng.standard_normal((ticks, 2))
    force = case.push / PUSH_SECONDS * _pushes(rng, ticks, rate)
    at = np.floor(time / GROUND_SECONDS).astype(int)
    ground = case.ground * rng.choice((-1, 1)) * np.array([0, 1, 0, -1])[at % 4]
    return _stepped(trial, within, time), torque, force, ground


def _pushes(rng: np.random.Generator, ticks: int, rate: float) -> Array:
    """Return when is pushed, with the sign, (ticks,): once in each second but the first."""
    pushes = np.zeros(ticks)
    length = max(1, round(PUSH_SECONDS * rate))
    for second in range(1, round(ticks / rate)):
        start = round((second + rng.uniform(0, 1 - PUSH_SECONDS)) * rate)
        pushes[start : start + length] = rng.choice((-1.0, 1.0))
    return pushes


def _stepped(trial: RobustnessTrial, within: tuple[float, float], time: Array) -> Array:
    """Return the command over time, m: away by a step and back, within the suite's heights."""
    low, high = within
    share = (trial.command - low) / (high - low) if high > low else 0.5
    bottom = trial.command - share * trial.case.command_step
    pair = (bottom, bottom + trial.case.command_step)
    first, second = pair if share <= 0.5 else pair[::-1]
    return np.where(np.floor(time / SWITCH_SECONDS) % 2 == 0, first, second)
