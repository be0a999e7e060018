"""How fine the physics must step: the same motions at many steps against a very fine one.

Single hops diverge after the first few whatever the step, since contact makes them chaotic. So the
first moments are compared as trajectories and long hopping by the statistics of its apexes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least, mm
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.errors import UsageError
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot import Robot, load_robot
from hopping_leg.robot.kinematics import joint_angles
from hopping_leg.sim import NO_NOISE, LegSimulator, NoiseAndDelay

REFERENCE = 6.25e-5
"""Physics step that the others are compared with, s."""

STEPS = (5e-3, 2.5e-3, 1.25e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
"""Physics steps that divide the control period of 200 Hz, coarse to fine, s."""

JUDGING, TRAINING = 0.0015, 0.005
"""Shift of a median apex that a claim about accuracy, and training, may bear, m."""

_STIFFNESS, _DAMPING = 60.0, 1.0
"""Joint PD of drop and stance, N m/rad and N m s/rad."""

_FIRST_HOPS = 3
"""Apexes that are compared one by one."""


@dataclass(frozen=True)
class ConvergenceStudy:
    """What is compared."""

    robots: Sequence[Robot]
    controllers: Sequence[str] = ("energy-shaping",)
    """Whose hops; names or policy files."""
    commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Desired heights, m."""
    seeds: int = 4
    """Realisations of noise and delay per command."""
    duration: float = 10.0
    """Of a hopping trial, s; the first fifth is left out."""
    steps: tuple[float, ...] = STEPS
    """Physics steps, s."""
    reference: float = REFERENCE
    """Finest physics step, s."""
    threads: int = 0


def bench_convergence(
    study: ConvergenceStudy, on_done: Callable[[int, int], None] | None = None
) -> dict[str, Any]:
    """Compare all steps with the reference.

    Returns:
        ``rows``, one per robot, step and controller, and ``largest_step_for_judging_s`` and
        ``largest_step_for_training_s``: the coarsest steps from which on no median apex of any
        robot shifts by more than ``JUDGING`` and ``TRAINING``.
    """
    rows: list[dict[str, Any]] = []
    total, done = len(study.robots) * len(study.steps), 0
    for robot in study.robots:
        fine = _motions(study, robot, study.reference)
        for step in study.steps:
            rows += _rows(study, robot, step, fine)
            done += 1
            if on_done is not None:
                on_done(done, total)
    return {
        "reference_timestep_s": study.reference,
        "rows": rows,
        "largest_step_for_judging_s": _sufficient(rows, JUDGING),
        "largest_step_for_training_s": _sufficient(rows, TRAINING),
        "judging_tolerance_m": JUDGING,
        "training_tolerance_m": TRAINING,
        "commands_m": list(study.commands),
        "seeds": study.seeds,
        "duration_s": study.duration,
        "controllers": list(study.controllers),
    }


@dataclass(frozen=True)
class _Motions:
    """Everything simulated at one physics step.

    Attributes:
        drop: Height after a drop, m, (ticks,).
        stance: Height in driven stance, m, (ticks,).
        apexes: By controller, then "quiet" or "noisy": apex heights by command, m.
        first: By controller: the first quiet apexes, m, (commands, hops).
    """

    drop: Array
    stance: Array
    apexes: dict[str, dict[str, list[Array]]]
    first: dict[str, Array]


def _motions(study: ConvergenceStudy, robot: Robot, step: float) -> _Motions:
    apexes: dict[str, dict[str, list[Array]]] = {}
    first: dict[str, Array] = {}
    for name in study.controllers:
        quiet = _hop(study, robot, step, name, NO_NOISE, seeds=1)
        noisy = _hop(study, robot, step, name, NoiseAndDelay(), study.seeds)
        first[name] = np.array([_padded(leg[0], _FIRST_HOPS) for leg in quiet])
        settled = {"quiet": quiet, "noisy": noisy}
        apexes[name] = {
            kind: [np.concatenate([_late(study, leg) for leg in group]) for group in groups]
            for kind, groups in ((kind, _by_command(study, legs)) for kind, legs in settled.items())
        }
    return _Motions(_drop(robot, step), _stance(robot, step), apexes, first)


Leg = tuple[Array, Array]
"""Apex heights, m, and their times, s, of one leg."""


def _hop(
    study: ConvergenceStudy,
    robot: Robot,
    step: float,
    name: str,
    disturbance: NoiseAndDelay,
    seeds: int,
) -> list[Leg]:
    """Let a controller hop; legs are ordered by command, then seed."""
    setup = RolloutConfig(robot, disturbance, timestep=step, threads=study.threads)
    commands = np.repeat(study.commands, seeds)
    ticks = round(study.duration * setup.rate)
    run = rollout(load_controller(name, robot), setup, np.tile(commands, (ticks, 1)), seed=0)
    height, rate = run.data["height_m"], run.data["height_rate_m_s"]
    clearance = run.data["foot_clearance_m"]
    legs = []
    for leg in range(len(commands)):
        hops = find_hops(height[:, leg], rate[:, leg], clearance[:, leg])
        legs.append((hops.apex, run.time[hops.tick]))
    return legs


def _by_command(study: ConvergenceStudy, legs: list[Leg]) -> list[list[Leg]]:
    seeds = len(legs) // len(study.commands)
    return [legs[i : i + seeds] for i in range(0, len(legs), seeds)]


def _late(study: ConvergenceStudy, leg: Leg) -> Array:
    return leg[0][leg[1] >= study.duration / 5]


def _padded(apexes: Array, count: int) -> Array:
    return np.append(apexes[:count], np.full(max(0, count - len(apexes)), np.nan))


def _drop(robot: Robot, step: float) -> Array:
    """Drop the leg from 0.1 m with its joints held; return its height, (ticks,)."""
    return _held(robot, step, lambda _: 0.7, clearance=0.1, seconds=1.0)


def _stance(robot: Robot, step: float) -> Array:
    """Bend and stretch the standing leg at 2 Hz; return its height, (ticks,)."""
    return _held(
        robot, step, lambda t: 0.7 + 0.12 * float(np.sin(4 * np.pi * t)), clearance=0.0, seconds=2.0
    )


def _held(
    robot: Robot, step: float, length: Callable[[float], float], clearance: float, seconds: float
) -> Array:
    """Track leg lengths (over the straight leg's) by joint PD; return the height, (ticks,)."""
    legs = LegSimulator(robot, 1, timestep=step, threads=1)
    reach = robot.thigh.length + robot.shank.length
    legs.stand(slice(None), joint_angles(robot, np.array([length(0.0) * reach, 0.0])), clearance)
    heights = np.empty(round(seconds * legs.rate))
    for tick in range(len(heights)):
        heights[tick] = legs.height[0]
        target = joint_angles(robot, np.array([length(tick * legs.period) * reach, 0.0]))
        legs.step(_STIFFNESS * (target - legs.q) - _DAMPING * legs.qd)
    return heights


def _rows(
    study: ConvergenceStudy, robot: Robot, step: float, fine: _Motions
) -> list[dict[str, Any]]:
    """Return the errors of one step, one row per controller."""
    coarse = _motions(study, robot, step)
    return [
        {
            "robot": robot.name,
            "timestep_s": step,
            "controller": name,
            "drop_height_error_m": _largest(coarse.drop - fine.drop),
            "stance_height_error_m": _largest(coarse.stance - fine.stance),
            "first_apexes_error_m": _largest(coarse.first[name] - fine.first[name]),
            **_shifts(coarse.apexes[name], fine.apexes[name]),
        }
        for name in study.controllers
    ]


def _shifts(coarse: dict[str, list[Array]], fine: dict[str, list[Array]]) -> dict[str, Any]:
    """Compare apex statistics, without noise and delay (quiet) and with them (noisy)."""
    result: dict[str, Any] = {}
    for kind in ("quiet", "noisy"):
        pairs = list(zip(coarse[kind], fine[kind], strict=True))
        shifts = [_difference(np.median, a, b) for a, b in pairs]
        spreads = [_difference(np.std, a, b) for a, b in pairs]
        result[f"{kind}_median_shifts_m"] = shifts
        result[f"{kind}_largest_median_shift_m"] = _worst(shifts)
        result[f"{kind}_largest_std_change_m"] = _worst(spreads)
        result[f"{kind}_hops"] = sum(len(a) for a, _ in pairs)
    return result


def _difference(of: Callable[[Array], Any], a: Array, b: Array) -> float | None:
    return float(of(a) - of(b)) if len(a) and len(b) else None


def _worst(shifts: list[float | None]) -> float | None:
    """Return the largest size, or None if a command has no hops at all."""
    sizes = [abs(shift) for shift in shifts if shift is not None]
    return max(sizes) if len(sizes) == len(shifts) else None


def _largest(error: Array) -> float | None:
    """Return the largest size, or None if nothing is comparable."""
    sizes = np.abs(error[np.isfinite(error)])
    return float(sizes.max()) if sizes.size else None


def _sufficient(rows: list[dict[str, Any]], tolerance: float) -> float | None:
    """Return the largest step below which every step keeps all noisy medians within tolerance."""
    largest = None
    for step in sorted({row["timestep_s"] for row in rows}):
        shifts = [row["noisy_largest_median_shift_m"] for row in rows if row["timestep_s"] == step]
        if any(shift is None or shift > tolerance for shift in shifts):
            break
        largest = step
    return largest


def stiff(robot: Robot) -> Robot:
    """Return the robot on MuJoCo's default, stiff floor."""
    contact = replace(robot.contact, time_constant=0.02, damping_ratio=1.0)
    return replace(robot, name=f"{robot.name}, stiff floor", contact=contact)


@dataclass(frozen=True)
class Convergence:
    """Compare physics steps from 5 to 0.125 ms with a much finer one."""

    controllers: tuple[str, ...] = ("energy-shaping",)
    """Whose hops are compared; names or .onnx files."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    stiff: bool = True
    """Compare on MuJoCo's default, stiff floor as well."""
    seeds: int = 4
    """Realisations of noise and delay per command."""
    duration: float = 10.0
    """Of a hopping trial, s."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, seeds=self.seeds)
        at_least(0, threads=self.threads)
        if not 1 <= self.duration <= 600:
            raise UsageError(f"--duration is {self.duration} s but must lie between 1 and 600 s.")
        robot = load_robot(self.robot)
        robots = [robot, stiff(robot)] if self.stiff else [robot]
        study = ConvergenceStudy(
            robots,
            controllers=self.controllers,
            seeds=self.seeds,
            duration=self.duration,
            threads=self.threads,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("simulating", total=None)
            result = bench_convergence(
                study, lambda done, total: bar.update(task, completed=done, total=total)
            )
        _print_convergence(result)
        return result


def _print_convergence(result: dict[str, Any]) -> None:
    table = Table(
        "robot", "step, ms", "drop, mm", "stance, mm", "controller", "median shift, mm", "noisy, mm"
    )
    for row in result["rows"]:
        table.add_row(
            row["robot"],
            f"{row['timestep_s'] * 1e3:g}",
            mm(row["drop_height_error_m"]),
            mm(row["stance_height_error_m"]),
            row["controller"],
            mm(row["quiet_largest_median_shift_m"]),
            mm(row["noisy_largest_median_shift_m"]),
        )
    console = Console()
    console.print(table)
    for purpose in ("judging", "training"):
        step = result[f"largest_step_for_{purpose}_s"]
        says = "no step suffices" if step is None else f"steps up to {step * 1e3:g} ms suffice"
        console.print(
            f"For {purpose}, {says} (medians within {mm(result[f'{purpose}_tolerance_m'])} mm)."
        )
