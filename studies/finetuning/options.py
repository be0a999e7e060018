"""Benchmark of continued training."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.finetune import guard_of
from hopping_leg.cli.options import at_least, mm
from hopping_leg.controllers.registry import load_policy
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot
from hopping_leg.sim.twins import draw_twin


@dataclass(frozen=True)
class Finetune:
    """Continue a policy's training on drawn twins by every method; judge it on other seeds."""

    policy: str = "fast"
    """A shipped policy or an .onnx file."""
    robot: str = "legv2-paper"
    """What is believed of the leg; the twins are drawn around it."""
    twins: tuple[int, ...] = (0, 1)
    """Seeds of the twins."""
    methods: tuple[Literal["aim", "sac", "both"], ...] = ("aim", "sac", "both")
    """What is learnt."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of the runs, one of each method and twin each."""
    minutes: float = 10.0
    """Robot time of a run at most."""
    judges: int = 3
    """Judging outings of each policy."""
    folder: Path = Path("runs/bench-finetune")
    """Where the runs are kept; finished ones are not repeated, killed ones go on."""
    figure: Path | None = None
    """Draw the errors over robot time to this file, .svg."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.figure_style import to_svg
        from hopping_leg.rl.finetune.config import FinetuneConfig, StoppingRules
        from studies.finetuning.figure import draw_finetuning
        from studies.finetuning.run import Study, measure

        at_least(1, judges=self.judges)
        at_least(0, **{f"seeds {seed}": seed for seed in (*self.seeds, *self.twins)})
        if not (self.twins and self.methods and self.seeds):
            raise UsageError("--twins, --methods and --seeds each need at least one entry.")
        policy, robot = load_policy(self.policy), load_robot(self.robot)
        console = Console()
        result = measure(
            Study(
                policy,
                robot,
                tuple(draw_twin(seed, self.robot).robot for seed in self.twins),
                self.methods,
                self.seeds,
                FinetuneConfig(stopping_rules=StoppingRules(minutes=self.minutes)),
                guard_of(robot, policy.card.rate),
                self.folder,
                judges=self.judges,
            ),
            lambda text: console.print(text, highlight=False),
        )
        if self.figure is not None:
            write_atomically(self.figure, to_svg(draw_finetuning(result)))
        _print(console, result)
        return result


def _print(console: Console, result: dict[str, Any]) -> None:
    table = Table("twin", "method", "|error|, mm", "best seed", "worst seed", "ended early")
    for row in result["rows"]:
        numbers = [mm(row[key]) for key in ("median_abs_error_m", "best_m", "worst_m")]
        table.add_row(row["twin"], row["method"], *numbers, str(row["ended_early"]))
    console.print(table)
