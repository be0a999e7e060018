"""Measure speed, convergence and accuracy; every number can be written as JSON.

Examples:
  hop bench env --json env.json
  hop bench convergence --json convergence.json
  hop bench inference fast --json inference.json
  hop bench training --training-seeds 0 1 2 --json training.json
  hop bench energy-shaping --json energy_shaping.json
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.output import write_json
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


@dataclass(frozen=True)
class Inference:
    """Time policies on one thread, from measurement to torque."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ()
    """Shipped names or .onnx files; all shipped ones by default."""
    calls: int = 5000
    """Timed decisions of each."""
    json: Path | None = None
    """Write every number to this file."""


@dataclass(frozen=True)
class EnergyShaping:
    """Judge energy shaping: the printed law, the tuned one, what each part is worth."""

    runs: int = 6
    """Realisations of noise and delay per command."""
    duration: float = 12.0
    """Of a run, s; the first 2 s do not count."""
    seed: int = 0
    """Of noise and delay; no seed of the benchmark has tuned anything."""
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    json: Path | None = None
    """Write every number to this file."""


@dataclass(frozen=True)
class Training:
    """Train a recipe from scratch with several seeds; judge every snapshot on other seeds."""

    recipe: str = "fast"
    """As for ``hop train``."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    training_seeds: tuple[int, ...] = (0, 1, 2)
    """One training each."""
    evaluation_seeds: int = 5
    """Realisations of noise and delay per command."""
    steps: int | None = None
    """Control steps of experience instead of the recipe's."""
    threads: int = 2
    """Of torch and physics."""
    out: Path = Path("runs/bench-training")
    """Where the trainings are kept; finished ones are not repeated, killed ones go on."""
    json: Path | None = None
    """Write every number to this file."""


@dataclass(frozen=True)
class Ablation:
    """Train the fast recipe with one part taken away at a time."""

    steps: int = 3_000_000
    """Control steps of experience of each variant."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    training_seeds: tuple[int, ...] = (0,)
    """One training of every variant each."""
    evaluation_seeds: int = 5
    """Realisations of noise and delay per command."""
    threads: int = 2
    """Of torch and physics."""
    out: Path = Path("runs/bench-ablation")
    """Where the trainings are kept; finished ones are not repeated, killed ones go on."""
    json: Path | None = None
    """Write every number to this file."""


Benchmark = Env | Convergence | Inference | EnergyShaping | Training | Ablation


def run(args: Benchmark) -> None:
    """Run one benchmark, print its numbers, write the JSON."""
    if isinstance(args, Env):
        result = _env(args)
    elif isinstance(args, EnergyShaping):
        result = _energy_shaping(args)
    elif isinstance(args, Convergence):
        result = _convergence(args)
    elif isinstance(args, Training):
        result = _training(args)
    elif isinstance(args, Ablation):
        result = _ablation(args)
    else:
        result = _inference(args)
    if args.json is not None:
        write_json(args.json, result)
        print(f"Wrote {args.json}.")


def _at_least(least: int, **values: int) -> None:
    for name, value in values.items():
        if value < least:
            raise UsageError(f"--{name} is {value} but must be {least} or more.")


def _env(args: Env) -> dict[str, Any]:
    from hopping_leg.evaluate.bench_env import EnvBenchmark, bench_env

    _at_least(1, count=args.count, repeats=args.repeats)
    _at_least(0, threads=args.threads, seed=args.seed)
    benchmark = EnvBenchmark(
        load_robot(args.robot),
        count=args.count,
        repeats=args.repeats,
        threads=args.threads,
        timestep=args.timestep,
        seed=args.seed,
    )
    with Progress(transient=True) as bar:
        task = bar.add_task("timing", total=args.repeats)
        result = bench_env(benchmark, lambda done, _: bar.update(task, completed=done))
    _print("Environment with noise and delay", result)
    return result


def _convergence(args: Convergence) -> dict[str, Any]:
    from hopping_leg.evaluate.bench_convergence import ConvergenceStudy, bench_convergence, stiff

    _at_least(1, seeds=args.seeds)
    _at_least(0, threads=args.threads)
    if not 1 <= args.duration <= 600:
        raise UsageError(f"--duration is {args.duration} s but must lie between 1 and 600 s.")
    robot = load_robot(args.robot)
    robots = [robot, stiff(robot)] if args.stiff else [robot]
    study = ConvergenceStudy(
        robots,
        controllers=args.controllers,
        seeds=args.seeds,
        duration=args.duration,
        threads=args.threads,
    )
    with Progress(transient=True) as bar:
        task = bar.add_task("simulating", total=None)
        result = bench_convergence(
            study, lambda done, total: bar.update(task, completed=done, total=total)
        )
    _print_convergence(result)
    return result


def _energy_shaping(args: EnergyShaping) -> dict[str, Any]:
    from hopping_leg.evaluate import bench_energy_shaping

    _at_least(1, runs=args.runs)
    _at_least(0, threads=args.threads, seed=args.seed)
    if not 4 <= args.duration <= 600:
        raise UsageError(f"--duration is {args.duration} s but must lie between 4 and 600 s.")
    with Progress(transient=True) as bar:
        task = bar.add_task("hopping", total=None)
        result = bench_energy_shaping.run(
            args.seed,
            runs=args.runs,
            seconds=args.duration,
            threads=args.threads,
            on_case=lambda done, total: bar.update(task, completed=done, total=total),
        )
    table = Table("case", "median error, mm", "std, mm", "hops/s", "skipped", "body contacts")
    for row in result["cases"]:
        sizes = [row["mean_abs_median_error_m"], row["mean_std_m"]]
        numbers = ["-" if x is None else f"{1e3 * x:.1f}" for x in sizes]
        numbers += [
            f"{row['hop_rate_hz']:.2f}",
            f"{row['skipped_hops']}",
            f"{row['body_contacts']}",
        ]
        table.add_row(row["case"], *numbers)
    Console().print(table)
    return result


def _inference(args: Inference) -> dict[str, Any]:
    from hopping_leg.evaluate.bench_inference import bench_inference

    _at_least(1, calls=args.calls)
    result = bench_inference(args.policies, args.calls)
    table = Table("policy", "network, median us", "99 %", "whole controller, median us", "99 %")
    for row in result["rows"]:
        times = ("inference_median_us", "inference_p99_us", "controller_median_us")
        cells = [f"{row[name]:.1f}" for name in (*times, "controller_p99_us")]
        table.add_row(row["policy"], *cells)
    Console().print(table)
    return result


def _training(args: Training) -> dict[str, Any]:
    from hopping_leg.evaluate.bench_training import bench_training
    from hopping_leg.learn.recipes import get_recipe

    _at_least(1, evaluation_seeds=args.evaluation_seeds, threads=args.threads)
    if not args.training_seeds:
        raise UsageError("--training-seeds names no seed; give e.g. --training-seeds 0 1 2.")
    recipe = get_recipe(args.recipe)
    if args.steps is not None:
        recipe = replace(recipe, steps=args.steps)
    console = Console()
    result = bench_training(
        recipe,
        load_robot(args.robot),
        args.out,
        training_seeds=args.training_seeds,
        evaluation_seeds=args.evaluation_seeds,
        threads=args.threads,
        on_progress=console.print,
    )
    table = Table("minutes", "seed", "command, m", "median error, mm", "std, mm", "skipped")
    for row in result["rows"]:
        table.add_row(f"{row['minutes']:.1f}", *_hops(row))
    console.print(table)
    return result


def _hops(row: dict[str, Any]) -> list[str]:
    errors = [_mm(row["median_error_m"]), _mm(row["std_m"])]
    return [str(row["seed"]), f"{row['command_m']:.2f}", *errors, str(row["skipped_hops"])]


def _ablation(args: Ablation) -> dict[str, Any]:
    from hopping_leg.evaluate.bench_ablation import bench_ablation

    _at_least(1, steps=args.steps, evaluation_seeds=args.evaluation_seeds, threads=args.threads)
    console = Console()
    result = bench_ablation(
        load_robot(args.robot),
        args.out,
        steps=args.steps,
        training_seeds=args.training_seeds,
        evaluation_seeds=args.evaluation_seeds,
        threads=args.threads,
        on_progress=console.print,
    )
    table = Table("variant", "seed", "command, m", "median error, mm", "std, mm", "skipped")
    for row in result["rows"]:
        table.add_row(row["meaning"], *_hops(row))
    console.print(table)
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
            _mm(row["drop_height_error_m"]),
            _mm(row["stance_height_error_m"]),
            row["controller"],
            _mm(row["quiet_largest_median_shift_m"]),
            _mm(row["noisy_largest_median_shift_m"]),
        )
    console = Console()
    console.print(table)
    for purpose in ("judging", "training"):
        step = result[f"largest_step_for_{purpose}_s"]
        says = "no step suffices" if step is None else f"steps up to {step * 1e3:g} ms suffice"
        console.print(
            f"For {purpose}, {says} (medians within {_mm(result[f'{purpose}_tolerance_m'])} mm)."
        )


def _mm(metres: float | None) -> str:
    return "no hops" if metres is None else f"{metres * 1e3:.2f}"
