"""Benchmarks of simulation, environment and inference."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.bench.shared import at_least, mm
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from hopping_leg.robot.model import TIMESTEP


@dataclass(frozen=True)
class Env:
    """Time the environment against bare physics and Gymnasium's Hopper-v5."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    count: int = 512
    """Legs of the batched environment."""
    repeats: int = 15
    """Rounds; medians over them are reported."""
    threads: int = 0
    """Of the batched environment and the batched physics alike, 0 for one per core."""
    timestep: float = TIMESTEP
    """Physics step, s."""
    seed: int = 0
    """Of noise and delay."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.bench_env import EnvBenchmark, bench_env

        at_least(1, count=self.count, repeats=self.repeats)
        at_least(0, threads=self.threads, seed=self.seed)
        benchmark = EnvBenchmark(
            load_robot(self.robot),
            count=self.count,
            repeats=self.repeats,
            threads=self.threads,
            timestep=self.timestep,
            seed=self.seed,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("timing", total=self.repeats)
            result = bench_env(benchmark, lambda done, _: bar.update(task, completed=done))
        _print("Environment with noise and delay", result)
        return result


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
        from hopping_leg.evaluate.bench_convergence import (
            ConvergenceStudy,
            bench_convergence,
            stiff,
        )

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


@dataclass(frozen=True)
class Inference:
    """Time policies on one thread, from measurement to torque."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ()
    """Shipped names or .onnx files; all shipped ones by default."""
    calls: int = 5000
    """Timed decisions of each."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.bench_inference import bench_inference

        at_least(1, calls=self.calls)
        result = bench_inference(self.policies, self.calls)
        table = Table("policy", "network, median us", "99 %", "whole controller, median us", "99 %")
        for row in result["rows"]:
            times = ("inference_median_us", "inference_p99_us", "controller_median_us")
            cells = [f"{row[name]:.1f}" for name in (*times, "controller_p99_us")]
            table.add_row(row["policy"], *cells)
        Console().print(table)
        return result


@dataclass(frozen=True)
class Reach:
    """Search for the highest lasting hops within torques, with the true state and no noise."""

    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    torques: tuple[tuple[float, float], ...] = ((6, 6), (6, 12), (10, 20))
    """Limits of hip and knee, N m at the joints: what the policies may ask for, the rated torque
    of the qdd100 behind its belt, and the motors' limit in the robot file of leg V2."""
    generations: int = 100
    """Of CMA-ES, for each pair."""
    population: int = 32
    """Candidates per generation."""
    seed: int = 0
    """Of the search."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    folder: Path = Path("runs/bench-reach")
    """Where what was found for a pair is kept; it is not searched again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.evaluate.keeper import Keeper
        from hopping_leg.evaluate.reach import ReachStudy, measure_reach

        at_least(1, generations=self.generations)
        at_least(4, population=self.population)
        at_least(0, threads=self.threads, seed=self.seed)
        if not self.torques or not all(t > 0 for pair in self.torques for t in pair):
            raise UsageError("--torques must be pairs of positive torques, N m; e.g. 6 6 10 20.")
        study = ReachStudy(
            load_robot(self.robot),
            self.torques,
            generations=self.generations,
            population=self.population,
            seed=self.seed,
            threads=self.threads,
        )
        with Progress(transient=True) as bar:
            task = bar.add_task("searching", total=None)
            result = measure_reach(
                study,
                Keeper(self.folder),
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        table = Table("hip, N m", "knee, N m", "apex, m", "hops/s", "rms hip", "rms knee", "hits")
        for row in result["rows"]:
            limits = [f"{row[f'{joint}_limit_nm']:g}" for joint in ("hip", "knee")]
            names = ("apex_m", "hop_rate_hz", "rms_hip_torque_nm", "rms_knee_torque_nm")
            cells = [f"{row[name]:.3g}" for name in names]
            table.add_row(*limits, *cells, str(row["body_contacts"]))
        Console().print(table)
        return result


def _print(title: str, result: dict[str, Any]) -> None:
    table = Table("number", "value", title=title)
    for name, value in result.items():
        if isinstance(value, int | float):
            table.add_row(name, f"{value:,.4g}" if value < 100 else f"{value:,.0f}")
    Console().print(table)


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
