"""Benchmark of what policies know."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot
from studies.probing.run import Study


@dataclass(frozen=True)
class Probe:
    """Read contact, phase and height off policies' hidden layers by a linear map."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ("fast", "paper")
    """Shipped names or .onnx files."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    study: Annotated[Study, tyro.conf.arg(name="")] = field(default_factory=Study)
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    figure: Path | None = None
    """Draw the scores into this file (.svg)."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.controllers import RolloutConfig
        from hopping_leg.controllers.registry import load_policy
        from hopping_leg.figure_style import to_svg
        from hopping_leg.io import write_atomically
        from hopping_leg.rl.onnx_export import expose_hidden
        from studies.probing.figure import draw_probe
        from studies.probing.run import run_study

        at_least(0, threads=self.threads, seed=self.study.seed)
        robot = load_robot(self.robot)
        policies = [load_policy(name) for name in self.policies]
        if len({policy.name for policy in policies}) < len(policies) or not policies:
            raise UsageError("Name one policy or more, each of another name.")
        for policy in policies:
            policy.check_robot(robot, other="warn")
        rates = {policy.card.rate for policy in policies}
        if len(rates) > 1:
            raise UsageError("The policies run at different control rates; probe them one by one.")
        setup = RolloutConfig(robot, threads=self.threads, rate=rates.pop())
        with Progress(transient=True) as bar:
            tasks = {policy.name: bar.add_task(policy.name, total=1.0) for policy in policies}
            result = run_study(
                policies,
                expose_hidden,
                setup,
                self.study,
                lambda name, share: bar.update(tasks[name], completed=share),
            )
        _print(result)
        if self.figure:
            write_atomically(self.figure, to_svg(draw_probe(result)))
        return result


def _print(result: dict[str, Any]) -> None:
    """Print a table per policy: a row per set of features, a column per target."""
    for name in result["policies"]:
        own = [row for row in result["rows"] if row["controller"] == name]
        table = Table("from", *dict.fromkeys(row["target"] for row in own), title=name)
        for features in dict.fromkeys(row["features"] for row in own):
            scores = [row["score"] for row in own if row["features"] == features]
            table.add_row(features, *(f"{score:.3f}" for score in scores))
        Console().print(table)
