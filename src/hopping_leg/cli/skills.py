"""`hop evaluate --suite skills`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from hopping_leg.cli.bench.shared import mm
from hopping_leg.evaluate.skills.suite import run_skills
from hopping_leg.io import write_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from hopping_leg.cli.evaluate import Evaluate
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.evaluate import Candidate


def judge_skills(
    args: "Evaluate",
    candidates: "list[Candidate]",
    setup: "RolloutConfig",
    on_progress: "Callable[[str, float], None]",
    command: str,
) -> dict[str, Any]:
    """Run the suite and write what was asked for.

    Args:
        args: The command line's.
        candidates: What is judged.
        setup: The world.
        on_progress: Called with a label and the share done.
        command: What makes this result again.

    Raises:
        UsageError: An option has no meaning here.
    """
    floors = ("soft", "stiff") if args.floor == "both" else (args.floor,)
    result = run_skills(
        candidates,
        setup,
        floors=floors,
        commands=args.commands,
        repeats=args.seeds,
        seed=args.seed,
        on_progress=on_progress,
    )
    result = {"command": command, **result}
    file: Path | None = args.json or (args.out / "skills.json" if args.out else None)
    if file:
        write_json(file, result)
    return result


def print_skills(console: Console, result: dict[str, Any]) -> None:
    """Print the tables of a result."""
    table = Table(
        "controller", "floor", "command, m", "hops asked", "exact", "at rest", "median error, mm",
        "landing, weights", title="Hop so many times and stop",
    )  # fmt: skip
    for row in result["counted"]:
        table.add_row(
            row["controller"],
            row["floor"],
            f"{row['command_m']:.2f}",
            str(row["asked"]),
            f"{100 * row['exact']:.0f} %",
            f"{100 * row['at_rest']:.0f} %",
            _mm(row["median_error_m"]),
            f"{row['landing_force']:.1f}",
        )
    console.print(table)
    table = Table(
        "controller", "floor", "command, m", "first hop, mm", "later, mm", "skipped",
        title="Stairs: worst step, apex minus command above the ground of the moment",
    )  # fmt: skip
    for row in result["climbs"]:
        table.add_row(
            row["controller"],
            row["floor"],
            f"{row['command_m']:.2f}",
            _mm(row["worst_first_error_m"]),
            _mm(row["worst_error_m"]),
            str(row["skipped_hops"]),
        )
    console.print(table)
    table = Table(
        "landing by", "floor", "peak force, weights", "hip, N m", "knee, N m", "rebound, mm",
        title=f"Dropped by {1e3 * result['conditions']['drop_m']:.0f} mm",
    )  # fmt: skip
    for row in result["landings"]:
        table.add_row(
            row["controller"],
            row["floor"],
            f"{row['peak_force']:.2f}",
            f"{row['peak_hip_torque_nm']:.1f}",
            f"{row['peak_knee_torque_nm']:.1f}",
            mm(row["rebound_m"]),
        )
    console.print(table)


def _mm(metres: float) -> str:
    return mm(metres if metres == metres else None)
