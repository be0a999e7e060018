"""Results in words and tables, the same columns for the terminal and for pages; lengths in mm.

Rows are the values of the JSON.
"""

import textwrap
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from markupsafe import Markup
from rich import box
from rich.table import Table

from hopping_leg.evaluate.result import Evaluation
from hopping_leg.html_page import Column, table
from hopping_leg.terminal import plain_console, print_table

Row = dict[str, Any]
_NARROW = 7  # characters of a heading on a line of the terminal


_LOOKS: dict[str, tuple[str, float, str]] = {
    **dict.fromkeys(("command_m", "commands_m", "lower_m", "upper_m"), ("m", 1, ".2f")),
    "p": ("", 1, ".1g"),
    "overlap": ("%", 100, ".1f"),
    **dict.fromkeys(("cliffs_delta", "cliffs_delta_low", "cliffs_delta_high"), ("", 1, "+.3f")),
    "_fraction": ("%", 100, ".0f"),
    "_share": ("%", 100, ".0f"),
    "_rad_s": ("rad/s", 1, ".1f"),
    "_minutes": ("min", 1, ".1f"),
    "_j": ("J", 1, ".1f"),
    "_weights": ("weights", 1, ".1f"),
    "energy_over_ballistic": ("", 1, ".1f"),
    "_hz": ("Hz", 1, ".2f"),
    "_nm": ("N\N{NO-BREAK SPACE}m", 1, ".1f"),
    "_m": ("mm", 1e3, ".1f"),
    "_w": ("W", 1, ".1f"),
    "_v": ("V", 1, ".1f"),
}
"""How values of a name, or of names with an ending, are shown: unit, factor, form."""

_BAD: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("skipped_hops", "body_contacts", "stop_contacts"), lambda count: count > 0),
    "rated_torque_share": lambda share: share > 1,
    "p": lambda p: p >= 1e-3,
}
"""What deserves attention."""


def _column(name: str) -> Column:
    """Return the column of an entry that rows have, under its name and unit; a dash for None."""
    ending = next((end for end in _LOOKS if end[0] == "_" and name.endswith(end)), "")
    unit, factor, form = _LOOKS.get(name, _LOOKS.get(ending, ("", 1, "")))
    form = f"+z{form}" if "median_error" in name else form
    words = name.removesuffix(ending).replace("_", " ")
    bad = _BAD.get(name, lambda _value: False)

    def text(row: Row) -> str:
        values = row[name] if isinstance(row[name], list) else [row[name]]
        shown = [v if v is None or not unit else factor * v for v in values]
        return " ".join("-" if v is None else format(v, form) for v in shown)

    return Column(
        f"{words} / {unit}" if unit else words,
        text,
        lambda row: row[name] is not None and bad(row[name]),
    )


def _columns(names: str) -> list[Column]:
    return [_column(name) for name in names.split()]


_HOW = "controller command_m"
_SHORT = f"{_HOW} median_error_m std_m hops skipped_hops flight_fraction min_base_height_m"
SHORT = _columns(f"{_SHORT} body_contacts")  # What the terminal shows of the summary

_ERROR = "median_error_m median_error_low_m median_error_high_m"

TABLES = {
    "summary": f"{_HOW} {_ERROR} std_m hops skipped_hops hop_rate_hz flight_fraction"
    " max_sink_m min_base_height_m body_contacts",
    "load": f"{_HOW} peak_hip_torque_nm peak_knee_torque_nm rms_hip_torque_nm rms_knee_torque_nm"
    " rated_torque_share thermal_minutes mean_power_w mean_electrical_power_w peak_regeneration_w"
    " bus_voltage_rise_v",
    "cost": f"{_HOW} energy_per_hop_j electrical_energy_per_hop_j ballistic_energy_j"
    " energy_over_ballistic hip_heat_w knee_heat_w peak_ground_force_weights",
    "joints": f"{_HOW} peak_knee_speed_rad_s torque_reversals_hz outside_limits_fraction"
    " soft_limit_share stop_contacts",
    "ladder": f"{_HOW} median_error_m std_m hops skipped_hops body_contacts",
    "staircase": "controller commands_m median_apexes_m monotone monotone_runs runs skipped_hops",
    "distributions": "controller lower_m upper_m p cliffs_delta cliffs_delta_low"
    " cliffs_delta_high overlap",
}
"""Tables of a page: what each shows of its rows, by their names in the JSON."""


def evaluation_tables(evaluation: Row) -> dict[str, Markup]:
    """Return every table of a page, by what it is about, from an evaluation's JSON."""
    summary, secondary = evaluation["summary"], evaluation["secondary"] or {"summary": []}
    rows = {**evaluation, "load": summary, "cost": summary, "joints": summary}
    rows["distributions"] = [
        {"controller": one["controller"], **pair}
        for one in evaluation["neighbours"]
        for pair in one["neighbours"]
    ]
    return {
        **{about: table(_columns(names), rows[about]) for about, names in TABLES.items()},
        "secondary": table(_columns(TABLES["summary"]), secondary["summary"]),
    }


def verdict(evaluation: Evaluation, controller: str) -> str:
    """Return in a sentence how near it hops to all its commands, what it skips and touches."""
    rows = [r for r in evaluation.summary + evaluation.ladder if r.controller == controller]
    errors = {row: abs(row.median_error_m) for row in rows if row.hops}
    if not errors:
        return "does not hop at any height."
    heights = {row.command_m for row in rows}
    still = sorted(heights - {row.command_m for row in errors})
    worst = max(errors, key=errors.__getitem__)
    skipped, touched = (sum(r.skipped_hops for r in rows), sum(r.body_contacts for r in rows))
    parts = [
        f"misses its command by {1e3 * median(errors.values()):.1f} mm in the median of"
        f" {len(heights)} heights and by {1e3 * errors[worst]:.1f} mm at the worst,"
        f" {worst.command_m:.2f} m",
        *([f"does not hop at {', '.join(f'{height:.2f}' for height in still)} m"] if still else []),
        f"skips {skipped} of {skipped + sum(row.hops for row in rows)} hops",
        f"base or knee touch the ground {touched} times",
    ]
    return f"{'; '.join(parts)}."


def print_evaluation(evaluation: Evaluation) -> None:
    """Print notes, the summary and a verdict on every controller."""
    _print_notes(evaluation.notes)
    for one in filter(None, (evaluation, evaluation.secondary)):
        c = one.conditions
        title = f"On {c['robot']}, {c['floor']} floor, {c['seeds']} seeds from {c['seed']}:"
        _print_table(title, SHORT, one.to_json()["summary"])
    for name in evaluation.controllers:
        plain_console().print(f"{name} {verdict(evaluation, name)}")


def print_robustness(result: Row) -> None:
    """Print notes and the scores on every axis."""
    _print_notes(result["notes"])
    c = result["conditions"]
    rows: dict[str, Row] = {}
    for score in result["scores"]:
        share, low, high = (f"{100 * score[name]:.0f}" for name in ("score", "low", "high"))
        row = rows.setdefault(score["axis"], {"axis": score["axis"]})
        row[score["controller"]] = f"{share} [{low}, {high}]"
    title = (
        f"Robustness on {c['robot']}: successful trials in % and their 95 % interval;"
        f" {', '.join(f'{command:g}' for command in c['commands_m'])} m,"
        f" {c['seeds']} seeds from {c['seed']}."
    )
    names = next(iter(rows.values()))
    _print_table(title, [_column(name) for name in names], list(rows.values()))


def _print_notes(notes: Sequence[str]) -> None:
    """Print what a reader must know before any table."""
    for note in notes:
        plain_console().print(f"Note: {note}")


def _print_table(title: str, columns: Sequence[Column], rows: Sequence[Row]) -> None:
    """Print a table under a sentence, within 80 columns where names allow."""
    plain_console().print(title)
    shown = Table(box=box.SIMPLE_HEAD, padding=0)
    shown.add_column(columns[0].heading, min_width=14)
    for column in columns[1:]:
        shown.add_column(
            textwrap.fill(column.heading, _NARROW, break_long_words=False), justify="right"
        )
    for row in rows:
        shown.add_row(*(column.text(row) for column in columns))
    print_table(shown)
