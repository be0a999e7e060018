"""Options of timing policies."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.table import Table

from hopping_leg.cli.options import at_least


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
        from studies.speed.inference import bench_inference

        at_least(1, calls=self.calls)
        result = bench_inference(self.policies, self.calls)
        table = Table("policy", "network, median us", "99 %", "whole controller, median us", "99 %")
        for row in result["rows"]:
            times = ("inference_median_us", "inference_p99_us", "controller_median_us")
            cells = [f"{row[name]:.1f}" for name in (*times, "controller_p99_us")]
            table.add_row(row["policy"], *cells)
        Console().print(table)
        return result
