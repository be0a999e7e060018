"""Results as tables for the terminal; lengths in mm, 80 columns where names allow."""

import dataclasses
import math
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.acceptance import acceptance_lines
from hopping_leg.evaluate.result import Evaluation


def print_tables(console: Console, evaluation: Evaluation) -> None:
    """Print the summary, what it was measured on, and notes."""
    console.print(summary_table(evaluation))
    if evaluation.secondary:
        console.print(summary_table(evaluation.secondary))
    for step in evaluation.staircase:
        verdict = "rises at every step" if step.monotone else "does not rise at every step"
        console.print(
            f"Staircase, {step.controller}: {verdict}"
            f" ({step.monotone_runs} of {step.runs} runs on their own),"
            f" {step.skipped_hops} skipped hops.",
            highlight=False,
        )
    for line in acceptance_lines(map(dataclasses.asdict, evaluation.summary)):
        console.print(line, highlight=False)
    for note in evaluation.notes:
        console.print(f"Note: {note}", highlight=False)


def _millimetres(value: float, form: str) -> str:
    return f"{1e3 * value:{form}}" if math.isfinite(value) else "-"


def _seeds(count: int) -> str:
    return f"{count} seed{'' if count == 1 else 's'}"


_HEADINGS = ("cmd", "error", "std", "hops", "skip", "1/s", "flight", "base", "contacts")


def summary_table(evaluation: Evaluation) -> Table:
    """Return the summary as a table for the terminal; lengths in mm."""
    conditions = evaluation.conditions
    table = Table(
        title=f"{conditions['robot']}, {conditions['floor']} floor, {_seeds(conditions['seeds'])}"
        f" from {conditions['seed']}; heights in mm",
        caption="error: median of apex - command; skip: skipped hops; 1/s: hop rate;\n"
        "base: lowest height over whole runs; contacts: of base or knee with the ground",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    table.add_column("controller", overflow="fold", min_width=22)
    for heading in _HEADINGS:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in evaluation.summary:
        table.add_row(
            row.controller,
            f"{1e3 * row.command_m:.0f}",
            _millimetres(row.median_error_m, "+.1f"),
            _millimetres(row.std_m, ".1f"),
            f"{row.hops}",
            f"{row.skipped_hops}",
            f"{row.hop_rate_hz:.2f}",
            f"{100 * row.flight_fraction:.0f} %",
            f"{1e3 * row.min_base_height_m:.0f}",
            f"{row.body_contacts}",
        )
    return table


def print_skills(console: Console, result: dict[str, Any]) -> None:
    """Print the tables of skills."""
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
            _millimetres(row["median_error_m"], ".2f"),
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
            _millimetres(row["worst_first_error_m"], ".2f"),
            _millimetres(row["worst_error_m"], ".2f"),
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
            _millimetres(row["rebound_m"], ".2f"),
        )
    console.print(table)
