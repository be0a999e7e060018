"""Options of the study of the physics step."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least, mm
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot


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
        from studies.physics_step.run import (
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
