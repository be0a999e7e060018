"""Try a policy as evaluation does: to choose among snapshots, and to correct a policy's command.

The seeds here select; they must never be among those that judge (1000 and above).
"""

import itertools
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg import io
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.rollout import Rollout, RolloutConfig, rollout
from hopping_leg.hop_detection import COLUMNS, HopMeasurement, measure_hops
from hopping_leg.rl.onnx_export import every_centimetre, with_shifts
from hopping_leg.rl.recipe import Recipe
from hopping_leg.robot.parameters import JOINTS, Robot

FIRST_SEED = 500
"""Judges every snapshot while training."""

FINAL_SEEDS = (501, 502, 503, 504)
"""Judge the best snapshots once more at the end."""

FINALISTS = 4
"""Snapshots that are tried once more at the end."""

CALIBRATION_SEEDS = (505, 506, 507, 508)
"""By whose hops a policy's command is corrected."""

_RANGE_SECONDS = 10.0
"""Of the trials that tell a policy's range of inputs."""

SETTLE = 0.2
"""Share of a trial at its start that does not count."""

_DISORDER = 0.1
"""Score for neighbouring commands whose hops are not in order, m."""

_UNRELIABLE = 0.01
"""Score for hops that are skipped or hit the ground at a command, however few, m."""

_PENALTY = 0.1
"""Score for every hop skipped and every contact of body and ground, per hop, m."""


@dataclass(frozen=True)
class CommandResult:
    """Hops at one command, pooled over legs and seeds."""

    command_m: float
    median_error_m: float
    """Median of apex - command, NaN without hops."""
    std_m: float
    """Standard deviation of the apexes, NaN without hops."""
    hops: int
    hops_per_s: float
    flight_fraction: float
    """Share of the time with the foot off the ground."""
    skipped_hops: int
    """Hops that should have happened and did not."""
    body_contact_ticks: int
    """Control steps with base or knee on the ground."""
    min_height_m: float
    """Lowest base height."""


def evaluate_policy(
    controller: Controller,
    robot: Robot,
    commands: tuple[float, ...],
    seeds: tuple[int, ...] = (FIRST_SEED,),
    rate: float = 200.0,
    threads: int = 0,
    *,
    legs: int = 4,
    seconds: float = 10.0,
    **world: Any,  # noqa: ANN401
) -> list[CommandResult]:
    """Let a controller hop at fixed commands, m, rising, with noise and delay.

    Each seed adds so many legs per command; ``threads`` of 0 are one per core. What is left are
    options of ``RolloutConfig``.
    """
    schedule = np.tile(np.repeat(commands, legs), (round(seconds * rate), 1))
    setup = RolloutConfig(robot, rate=rate, threads=threads, **world)
    runs = [rollout(controller, setup, schedule, seed) for seed in seeds]
    return [
        _command_result(runs, command, range(index * legs, (index + 1) * legs), rate)
        for index, command in enumerate(commands)
    ]


def input_range(
    policy: Policy, robot: Robot, commands: tuple[float, ...], rate: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the least and the largest ``controllers.policy.INPUTS`` in trials at commands, m.

    Of a policy for any leg, commands and velocities are those of a leg of the paper's size.
    """
    policy.set_robot(robot)
    schedule = np.tile(np.multiply(policy.scale, commands), (round(_RANGE_SECONDS * rate), 1))
    run = rollout(policy, RolloutConfig(robot, rate=rate), schedule, FINAL_SEEDS[0])
    units = {"position_rad": 1.0, "velocity_rad_s": np.sqrt(policy.scale)}
    columns = [
        unit * run.data[f"{joint}_{name}"] for name, unit in units.items() for joint in JOINTS
    ]
    return tuple(float(c.min()) for c in columns), tuple(float(c.max()) for c in columns)


def score(results: list[CommandResult]) -> float:
    """Return how bad a policy is, m.

    Mean over commands of median error + spread + penalties, 1 without hops, and of a penalty where
    hops are skipped or the body hits the ground at all, and a penalty for every pair of
    neighbouring commands of which the higher one does not give the higher hops.
    """

    def at_command(result: CommandResult) -> float:
        if result.hops == 0:
            return 1.0
        faults = (result.skipped_hops + result.body_contact_ticks) / result.hops
        return abs(result.median_error_m) + result.std_m + _PENALTY * min(faults, 3.0)

    heights = [v.command_m + v.median_error_m for v in results]
    disordered = sum(not low < high for low, high in itertools.pairwise(heights))
    unreliable = [v.skipped_hops + v.body_contact_ticks > 0 for v in results]
    worse = _UNRELIABLE * float(np.mean(unreliable)) + _DISORDER * disordered
    return float(np.mean([at_command(v) for v in results])) + worse


def _command_result(runs: list[Rollout], command: float, legs: range, rate: float) -> CommandResult:
    start = round(SETTLE * len(runs[0].time))
    hops: list[HopMeasurement] = []
    contacts, lowest = 0, np.inf
    for run in runs:
        for leg in legs:
            data = {name: values[:, leg] for name, values in run.data.items()}
            height, velocity, clearance = (data[name] for name in COLUMNS)
            hops.append(measure_hops(height, velocity, clearance, rate, start))
            body = np.minimum(data["base_clearance_m"], data["knee_clearance_m"])
            contacts += int((body <= 0).sum())
            lowest = min(lowest, float(height.min()))
    apex = np.concatenate([h.apex for h in hops])
    ticks = sum(h.ticks for h in hops)
    return CommandResult(
        command_m=command,
        median_error_m=float(np.median(apex) - command) if len(apex) else float("nan"),
        std_m=float(apex.std()) if len(apex) else float("nan"),
        hops=len(apex),
        hops_per_s=len(apex) * rate / ticks,
        flight_fraction=sum(h.flight_ticks for h in hops) / ticks,
        skipped_hops=sum(h.skipped for h in hops),
        body_contact_ticks=contacts,
        min_height_m=lowest,
    )


_MOST = 0.02
"""Largest shift, m."""

_TRUSTED = 0.01
"""Error of which a round corrects no more, m."""


def calibrate(content: bytes, robot: Robot, rounds: int) -> bytes:
    """Return a policy file with the command map with which it meets its commands.

    Round k, on a seed of its own, corrects the k-th part of the remaining error: the mean of what
    the rounds tell, at most one per calibration seed. Heights without hops keep their shift.
    """
    card = Policy(content, "calibration", "policy").card
    heights = every_centimetre((card.command_low, card.command_high))
    shifts = np.zeros(len(heights))
    for number, seed in enumerate(CALIBRATION_SEEDS[:rounds], start=1):
        policy = Policy(with_shifts(content, shifts), "calibration", "policy")
        results = evaluate_policy(policy, robot, heights, (seed,), card.rate)
        errors = np.nan_to_num([result.median_error_m for result in results])
        shifts -= errors.clip(-_TRUSTED, _TRUSTED) / number
        shifts = shifts.clip(-_MOST, _MOST)
    return with_shifts(content, shifts)


class Selection:
    """Tries every snapshot on one seed; the best few again on others, and one of those wins.

    Snapshots are kept in ``folder``, named by their steps.
    """

    def __init__(self, recipe: Recipe, robot: Robot, folder: Path) -> None:
        self._recipe, self._robot, self._folder = recipe, robot, folder
        self.rows: list[dict[str, Any]] = []
        """Every snapshot so far: steps, minutes, score and trials, as JSON values."""

    @property
    def next_at(self) -> int:
        """Steps after which the next snapshot is due."""
        every = self._recipe.selection.eval_every
        return every * (self.rows[-1]["steps"] // every + 1) if self.rows else every

    def _file(self, steps: int) -> Path:
        return self._folder / f"{steps:012d}.onnx"

    def add(self, steps: int, minutes: float, content: bytes) -> dict[str, Any]:
        """Keep and try a policy file; return its row."""
        io.write_atomically(self._file(steps), content)
        self.rows.append({"steps": steps, "minutes": minutes, **self.trials(content)})
        return self.rows[-1]

    def choose(self) -> tuple[bytes, dict[str, Any]]:
        """Return the best policy file and its row, with the scores of all finalists."""
        ranked = sorted(self.rows, key=lambda row: float(row["score_m"]))[:FINALISTS]
        if len(ranked) == 1 and self._recipe.selection.calibrations:  # is tried again in any case
            best = {**ranked[0], "seeds": list(FINAL_SEEDS)}
            return self._file(best["steps"]).read_bytes(), best
        finals = [
            row | self.trials(self._file(row["steps"]).read_bytes(), FINAL_SEEDS) for row in ranked
        ]
        best = min(finals, key=lambda row: float(row["score_m"]))
        scores = [{"steps": row["steps"], "score_m": row["score_m"]} for row in finals]
        best |= {"finalists": scores, "seeds": list(FINAL_SEEDS)}
        return self._file(best["steps"]).read_bytes(), best

    def trials(self, content: bytes, seeds: tuple[int, ...] = (FIRST_SEED,)) -> dict[str, Any]:
        """Return score, m, and trials of a policy file, as JSON values."""
        recipe = self._recipe
        policy = Policy(content, "snapshot", recipe.name)
        policy.set_robot(self._robot)
        commands, rate = recipe.selection.eval_commands, recipe.task.rate
        results = evaluate_policy(policy, self._robot, commands, seeds, rate)
        return {
            "score_m": score(results),
            "trials": io.plain([asdict(v) for v in results]),
        }
