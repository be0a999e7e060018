"""The benchmark as tables for the terminal."""

import math
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.robustness.score import OVERALL


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
