"""Results in words and tables, the same columns for the terminal and for pages; lengths in mm.

Rows are the values of the JSON.
"""

import textwrap
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from markupsafe import Markup
from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.result import Evaluation
from hopping_leg.html_page import Column, table
from hopping_leg.terminal import print_table

Row = dict[str, Any]
_NARROW = 8  # characters of a heading on a line of the terminal


def millimetres(value: float | None, sign: bool = False) -> str:
    """Return a length in mm; a dash where there is none."""
    there = value is not None and value == value
    return f"{1e3 * value:{'+' if sign else ''}z.1f}" if there else "-"  # type: ignore[operator]


def _column(
    heading: str,
    name: str,
    form: str = "",
    scale: float = 1,
    bad: Callable[[Any], bool] = lambda _value: False,
) -> Column:
    """Return the column of an entry that rows have, scaled and formatted; a dash for None."""

    def text(row: Row) -> str:
        value = row[name]
        return "-" if value is None else format(value if scale == 1 else scale * value, form)

    return Column(heading, text, lambda row: row[name] is not None and bad(row[name]))


def _pair(heading: str, form: str, *names: str, sign: bool = False) -> Column:
    """Return a column of two lengths, put into a form such as ``"{} to {}"``."""
    return Column(heading, lambda row: form.format(*(millimetres(row[n], sign) for n in names)))


def _count(heading: str, name: str) -> Column:
    """Return a column of what should not have happened."""
    return _column(heading, name, bad=lambda count: count > 0)


_CONTROLLER = _column("controller", "controller")
_COMMAND = _column("command / m", "command_m", ".2f")
_ERROR = _column("median error / mm", "median_error_m", "+z.1f", 1e3)
_INTERVAL = _pair(
    "95 % interval / mm", "{} to {}", "median_error_low_m", "median_error_high_m", sign=True
)
_STD = _column("std / mm", "std_m", ".1f", 1e3)
_HOPS = _column("hops", "hops")
_SKIPPED = _count("skipped", "skipped_hops")
_FLIGHT = _column("flight / %", "flight_fraction", ".0f", 100)
_LOWEST = _column("lowest base / mm", "min_base_height_m", ".0f", 1e3)
_CONTACTS = _count("body contacts", "body_contacts")

SHORT = (_CONTROLLER, _COMMAND, _ERROR, _STD, _HOPS, _SKIPPED, _FLIGHT, _LOWEST, _CONTACTS)
"""What the terminal shows of the summary."""

SUMMARY = (
    *(_CONTROLLER, _COMMAND, _ERROR, _INTERVAL, _STD, _column("IQR / mm", "iqr_m", ".1f", 1e3)),
    *(_HOPS, _SKIPPED, _column("hops / s", "hop_rate_hz", ".2f"), _FLIGHT),
    *(_column("sink / mm", "max_sink_m", ".0f", 1e3), _LOWEST, _CONTACTS),
)

LOAD = (
    _CONTROLLER,
    _COMMAND,
    _column("peak hip / N m", "peak_hip_torque_nm", ".1f"),
    _column("peak knee / N m", "peak_knee_torque_nm", ".1f"),
    _column("RMS hip / N m", "rms_hip_torque_nm", ".1f"),
    _column("RMS knee / N m", "rms_knee_torque_nm", ".1f"),
    _column("RMS of rated / %", "rated_torque_share", ".0f", 100, bad=lambda share: share > 1),
    _column("limited after / min", "thermal_minutes", ".1f"),
    _column("mechanical / W", "mean_power_w", ".1f"),
    _column("electrical / W", "mean_electrical_power_w", ".1f"),
    _column("peak braking / W", "peak_regeneration_w", ".0f"),
    _column("bus rise / V", "bus_voltage_rise_v", ".1f"),
)

JOINTS = (
    _CONTROLLER,
    _COMMAND,
    _column("knee speed / (rad/s)", "peak_knee_speed_rad_s", ".1f"),
    _column("torque reversals / Hz", "torque_reversals_hz", ".1f"),
    _column("outside soft limits / %", "outside_limits_fraction", ".1f", 100),
    _column("soft limits, RMS / N m", "soft_limit_rms_nm", ".2f"),
    _column("soft limits' share of torque / %", "soft_limit_share", ".1f", 100),
    _count("stop contacts", "stop_contacts"),
)

GROUPS = (
    _column("group", "group"),
    *(_COMMAND, _column("policies", "policies"), _count("never hopped", "motionless")),
    *(_ERROR, _INTERVAL, _column("worst |error| / mm", "worst_abs_error_m", ".1f", 1e3)),
    *(_column("median std / mm", "median_std_m", ".1f", 1e3), _SKIPPED, _CONTACTS),
)

ESTIMATORS = (
    _CONTROLLER,
    _pair("in flight / mm", "{} ± {}", "flight_bias_m", "flight_std_m"),
    _pair("in stance / mm", "{} ± {}", "stance_bias_m", "stance_std_m"),
    _pair("apex, after landing / mm", "{} ± {}", "apex_bias_m", "apex_std_m"),
    _HOPS,
)

NEIGHBOURS = (
    _CONTROLLER,
    _column("lower command / m", "lower_m", ".2f"),
    _column("higher command / m", "upper_m", ".2f"),
    _column("p, rank sums of runs", "p", ".1g", bad=lambda p: p >= 1e-3),
    _column("Cliff's delta", "cliffs_delta", "+.3f"),
    _column("95 % from", "cliffs_delta_low", "+.3f"),
    _column("to", "cliffs_delta_high", "+.3f"),
    _column("hops in the overlap / %", "overlap", ".1f", 100),
)


def evaluation_tables(evaluation: Row) -> dict[str, Markup]:
    """Return every table of a page, by what it is about, from an evaluation's JSON."""
    summary, secondary = evaluation["summary"], evaluation["secondary"] or {"summary": []}
    pairs = [
        {"controller": one["controller"], **pair}
        for one in evaluation["neighbours"]
        for pair in one["neighbours"]
    ]
    about = "estimated minus true, mean ± standard deviation"
    return {
        "summary": table(SUMMARY, summary),
        "secondary": table(SUMMARY, secondary["summary"]),
        "groups": table(GROUPS, evaluation["groups"]),
        "load": table(LOAD, summary),
        "joints": table(JOINTS, summary),
        "ladder": table(
            (_CONTROLLER, _COMMAND, _ERROR, _STD, _HOPS, _SKIPPED, _CONTACTS), evaluation["ladder"]
        ),
        "distributions": table(NEIGHBOURS, pairs),
        "staircase": _staircase_table(evaluation["staircase"]),
        "estimators": table(ESTIMATORS, evaluation["estimators"], about),
    }


def _staircase_table(stairs: Sequence[Row]) -> Markup:
    """Return medians per step and what follows from them; all climb the same steps."""

    def step(number: int, command: float) -> Column:
        return Column(f"{command:.2f} m", lambda row: millimetres(row["median_apexes_m"][number]))

    commands = stairs[0]["commands_m"] if stairs else ()
    columns = (
        *(_CONTROLLER, *(step(number, command) for number, command in enumerate(commands))),
        Column("monotone", lambda row: "yes" if row["monotone"] else "no"),
        Column("runs monotone", lambda row: f"{row['monotone_runs']} of {row['runs']}"),
        _SKIPPED,
    )
    return table(columns, stairs, "median apex at each step / mm")


def verdict(evaluation: Evaluation, controller: str) -> str:
    """Return in a sentence how near it hops to its commands, what it skips, touches and heats.

    Heights between and beyond the commands count, too.
    """
    own = evaluation.rows(controller)
    rows = own + [row for row in evaluation.ladder if row.controller == controller]
    errors = {row: abs(row.median_error_m) for row in rows if row.hops}
    if not errors:
        return "does not hop at any height."
    worst = max(errors, key=errors.__getitem__)
    skipped, touched = (sum(r.skipped_hops for r in rows), sum(r.body_contacts for r in rows))
    hops = skipped + sum(row.hops for row in rows)
    parts = [
        f"misses its command by {_mm(median(errors.values()))} in the median of"
        f" {len({row.command_m for row in rows})} heights and by {_mm(errors[worst])} at the worst,"
        f" {worst.command_m:.2f} m"
    ]
    if still := sorted({row.command_m for row in rows} - {row.command_m for row in errors}):
        parts.append(f"does not hop at {', '.join(f'{command:.2f}' for command in still)} m")
    parts.append(f"skips {skipped} of {hops} hops" if skipped else "skips no hop")
    times = "once" if touched == 1 else f"{touched} times"
    ground = f"base or knee touch the ground {times}" if touched else ""
    parts.append(ground or "only the foot touches the ground")
    for stair in evaluation.staircase:
        if stair.controller == controller:
            rises = "rises" if stair.monotone else "does not rise"
            parts.append(f"{rises} at every step of the staircase")
    if (share := max(row.rated_torque_share for row in own)) > 1:
        minutes = min(row.thermal_minutes for row in own)
        parts.append(f"its motors give {share:.0%} of their rated torque, for {minutes:.0f} min")
    other = evaluation.secondary
    if other is not None and (there := [r for r in other.rows(controller) if r.hops]):
        most = max(abs(row.median_error_m) for row in there)
        parts.append(f"on the {other.conditions['floor']} floor misses by {_mm(most)} at the worst")
    return f"{'; '.join(parts)}."


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


def print_evaluation(console: Console, evaluation: Evaluation) -> None:
    """Print notes, the summary and a verdict on every controller."""
    _print_notes(console, evaluation.notes)
    for one in filter(None, (evaluation, evaluation.secondary)):
        c = one.conditions
        title = f"On {c['robot']}, {c['floor']} floor, {c['seeds']} seeds from {c['seed']}:"
        _print_table(console, title, SHORT, one.to_json()["summary"])
    for name in evaluation.controllers:
        console.print(f"{name} {verdict(evaluation, name)}")


def print_robustness(console: Console, result: Row) -> None:
    """Print notes and the scores on every axis."""
    _print_notes(console, result["notes"])
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
    _print_table(console, title, [_column(name, name) for name in names], list(rows.values()))


def _print_notes(console: Console, notes: Sequence[str]) -> None:
    """Print what a reader must know before any table."""
    for note in notes:
        console.print(f"Note: {note}")


def _print_table(
    console: Console, title: str, columns: Sequence[Column], rows: Sequence[Row]
) -> None:
    """Print a table under a sentence, within 80 columns where names allow."""
    console.print(title)
    shown = Table(box=box.SIMPLE_HEAD, padding=0)
    shown.add_column(columns[0].heading, min_width=14)
    for column in columns[1:]:
        shown.add_column(textwrap.fill(column.heading, _NARROW), justify="right")
    for row in rows:
        shown.add_row(*(column.text(row) for column in columns))
    print_table(shown, console)
