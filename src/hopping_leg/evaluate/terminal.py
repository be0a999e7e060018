"""Results as tables for the terminal; lengths in mm, 80 columns where names allow."""

import dataclasses
import math
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.acceptance import acceptance_lines
from hopping_leg.evaluate.result import Evaluation
from hopping_leg.evaluate.robustness.outcome import OVERALL


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


def print_robustness(console: Console, result: dict[str, Any]) -> None:
    """Print scores, what follows a change, and notes."""
    console.print(score_table(result))
    if result["recovery"]:
        console.print(recovery_table(result))
    for row in result["steps"]:
        settled = row["settled_after_hops"]
        console.print(
            f"{row['controller']}, command {row['from_m']:g} to {row['to_m']:g} m:"
            f" {'not settled' if settled is None else f'settled after {settled} hops'}.",
            highlight=False,
        )
    for note in result["notes"]:
        console.print(f"Note: {note}", highlight=False)


def score_table(result: dict[str, Any]) -> Table:
    """Return every controller's score on every axis, in percent with its interval."""
    conditions = result["conditions"]
    commands = ", ".join(f"{command:g}" for command in conditions["commands_m"])
    table = Table(
        title=f"Robustness, {conditions['robot']}: successful trials in %",
        caption=f"{commands} m, {conditions['seeds']} seeds from {conditions['seed']}; in brackets"
        " the 95 % interval;\nR: on RealAIGym's leaderboard, too",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    controllers = list(dict.fromkeys(row["controller"] for row in result["scores"]))
    table.add_column("axis")
    table.add_column("R", min_width=3, justify="center")
    for name in controllers:
        table.add_column(name, justify="right", overflow="fold", min_width=14)
    marked = {axis["name"]: bool(axis["leaderboard"]) for axis in result["axes"]}
    cells = {(row["controller"], row["axis"]): _interval(row) for row in result["scores"]}
    for axis in (*marked, OVERALL):
        row = (cells[name, axis] for name in controllers)
        table.add_row(axis, "x" if marked.get(axis) else "", *row)
    return table


def recovery_table(result: dict[str, Any]) -> Table:
    """Return the hops after which each controller is back, per change and command."""
    commands = result["conditions"]["commands_m"]
    table = Table(
        title="Hops until back after a change in the middle of a run",
        caption=f"back: within {1e3 * result['conditions']['back_m']:g} mm of the command from"
        " there on; in brackets\nthe error of hop 6 and later in mm; -: not back",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    table.add_column("change")
    table.add_column("controller", overflow="fold", min_width=14)
    for command in commands:
        table.add_column(f"{command:g} m", justify="right", min_width=10)
    cells = {(r["change"], r["controller"], r["command_m"]): _back(r) for r in result["recovery"]}
    for change, controller in dict.fromkeys(key[:2] for key in cells):
        table.add_row(
            change, controller, *(cells[change, controller, command] for command in commands)
        )
    return table


def _interval(row: dict[str, Any]) -> str:
    score = f"{100 * row['score']:.0f}"
    if not math.isfinite(row["low"]):
        return score
    return f"{score} [{100 * row['low']:.0f}, {100 * row['high']:.0f}]"


def _back(row: dict[str, Any]) -> str:
    hops, later = row["back_after_hops"], row["later_abs_error_m"]
    size = "-" if later is None else f"{1e3 * later:.0f}"
    return f"{'-' if hops is None else hops} [{size}]"
