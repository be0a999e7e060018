"""The summary as tables for the terminal; lengths in mm, 80 columns where names allow."""

import math

from rich import box
from rich.console import Console
from rich.table import Table

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
    for note in evaluation.notes:
        console.print(f"Note: {note}", highlight=False)


def _millimetres(value: float, form: str) -> str:
    return f"{1e3 * value:{form}}" if math.isfinite(value) else "-"


def _seeds(count: int) -> str:
    return f"{count} seed{'' if count == 1 else 's'}"


_HEADINGS = ("cmd", "error", "std", "hops", "skip", "1/s", "flight", "base", "hits")


def summary_table(evaluation: Evaluation) -> Table:
    """Return the summary as a table for the terminal; lengths in mm."""
    conditions = evaluation.conditions
    table = Table(
        title=f"{conditions['robot']}, {conditions['floor']} floor, {_seeds(conditions['seeds'])}"
        f" from {conditions['seed']}; heights in mm",
        caption="error: median of apex - command; skip: skipped hops; 1/s: hop rate;\n"
        "base: lowest height over whole runs; hits: contacts of base or knee with the ground",
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
