"""Results in words and tables, one list of columns for the terminal and for pages; lengths in mm.

Rows are the values of the JSON.
"""

import itertools
import textwrap
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from markupsafe import Markup
from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.result import Evaluation, Summary
from hopping_leg.html_page import Column, table
from hopping_leg.terminal import print_table

Row = dict[str, Any]
_NARROW = 8  # characters of a heading on a line of the terminal


def millimetres(value: float | None, sign: bool = False) -> str:
    """Return a length in mm; a dash where there is none."""
    there = value is not None and value == value
    return f"{1e3 * value:{'+' if sign else ''}z.1f}" if there else "-"  # type: ignore[operator]


def _positive(value: float) -> bool:
    return value > 0


def column(
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


_CONTROLLER = column("controller", "controller")
_COMMAND = column("command / m", "command_m", ".2f")
_ERROR = column("median error / mm", "median_error_m", "+z.1f", 1e3)
_INTERVAL = _pair(
    "95 % interval / mm", "{} to {}", "median_error_low_m", "median_error_high_m", sign=True
)
_STD = column("std / mm", "std_m", ".1f", 1e3)
_HOPS = column("hops", "hops")
_SKIPPED = column("skipped", "skipped_hops", bad=_positive)
_RATE = column("hops / s", "hop_rate_hz", ".2f")
_FLIGHT = column("flight / %", "flight_fraction", ".0f", 100)
_LOWEST = column("lowest base / mm", "min_base_height_m", ".0f", 1e3)
_CONTACTS = column("body contacts", "body_contacts", bad=_positive)

SHORT = (_CONTROLLER, _COMMAND, _ERROR, _STD, _HOPS, _SKIPPED, _FLIGHT, _LOWEST, _CONTACTS)
"""What the terminal shows of the summary."""

SUMMARY = (
    *(_CONTROLLER, _COMMAND, _ERROR, _INTERVAL, _STD, column("IQR / mm", "iqr_m", ".1f", 1e3)),
    *(_HOPS, _SKIPPED, _RATE, _FLIGHT, column("sink / mm", "max_sink_m", ".0f", 1e3)),
    *(_LOWEST, _CONTACTS),
)
LADDER = (_CONTROLLER, _COMMAND, _ERROR, _STD, _HOPS, _SKIPPED, _CONTACTS)

LOAD = (
    _CONTROLLER,
    _COMMAND,
    column("peak hip / N m", "peak_hip_torque_nm", ".1f"),
    column("peak knee / N m", "peak_knee_torque_nm", ".1f"),
    column("RMS hip / N m", "rms_hip_torque_nm", ".1f"),
    column("RMS knee / N m", "rms_knee_torque_nm", ".1f"),
    column("RMS of rated / %", "rated_torque_share", ".0f", 100, bad=lambda share: share > 1),
    column("limited after / min", "thermal_minutes", ".1f"),
    column("mechanical / W", "mean_power_w", ".1f"),
    column("electrical / W", "mean_electrical_power_w", ".1f"),
    column("peak braking / W", "peak_regeneration_w", ".0f"),
    column("bus rise / V", "bus_voltage_rise_v", ".1f"),
)

JOINTS = (
    _CONTROLLER,
    _COMMAND,
    column("knee speed / (rad/s)", "peak_knee_speed_rad_s", ".1f"),
    column("torque reversals / Hz", "torque_reversals_hz", ".1f"),
    column("outside soft limits / %", "outside_limits_fraction", ".1f", 100),
    column("soft limits, RMS / N m", "soft_limit_rms_nm", ".2f"),
    column("soft limits' share of torque / %", "soft_limit_share", ".1f", 100),
    column("stop contacts", "stop_contacts", bad=_positive),
)

GROUPS = (
    column("group", "group"),
    _COMMAND,
    column("policies", "policies"),
    column("never hopped", "motionless", bad=_positive),
    _ERROR,
    _INTERVAL,
    column("worst |error| / mm", "worst_abs_error_m", ".1f", 1e3),
    column("median std / mm", "median_std_m", ".1f", 1e3),
    _SKIPPED,
    _CONTACTS,
)

ESTIMATORS = (
    _CONTROLLER,
    _pair("in flight / mm", "{} ± {}", "flight_bias_m", "flight_std_m"),
    _pair("in stance / mm", "{} ± {}", "stance_bias_m", "stance_std_m"),
    _pair("apex, after landing / mm", "{} ± {}", "apex_bias_m", "apex_std_m"),
    _HOPS,
)

_NEIGHBOURS = (
    _CONTROLLER,
    column("lower command / m", "lower_m", ".2f"),
    column("higher command / m", "upper_m", ".2f"),
    column("p, rank sums of runs", "p", ".1g", bad=lambda p: p >= 1e-3),
    column("Cliff's delta", "cliffs_delta", "+.3f"),
    column("95 % from", "cliffs_delta_low", "+.3f"),
    column("to", "cliffs_delta_high", "+.3f"),
    column("hops in the overlap / %", "overlap", ".1f", 100),
)


def evaluation_tables(evaluation: Row) -> dict[str, Markup]:
    """Return every table of a page, by what it is about, from an evaluation's JSON."""
    secondary, summary = evaluation["secondary"], evaluation["summary"]
    neighbours = [
        {"controller": one["controller"], **pair}
        for one in evaluation["neighbours"]
        for pair in one["neighbours"]
    ]
    return {
        "summary": table(SUMMARY, summary),
        "secondary": table(SUMMARY, secondary["summary"] if secondary else []),
        "groups": table(GROUPS, evaluation["groups"]),
        "load": table(LOAD, summary),
        "joints": table(JOINTS, summary),
        "ladder": table(LADDER, evaluation["ladder"]),
        "distributions": table(_NEIGHBOURS, neighbours),
        "staircase": _staircase_table(evaluation["staircase"]),
        "estimators": table(
            ESTIMATORS, evaluation["estimators"], "estimated minus true, mean ± standard deviation"
        ),
    }


def _staircase_table(stairs: Sequence[Row]) -> Markup:
    """Return medians per step and what follows from them; all climb the same steps."""

    def step(number: int, command: float) -> Column:
        return Column(f"{command:.2f} m", lambda row: millimetres(row["median_apexes_m"][number]))

    steps = itertools.starmap(step, enumerate(stairs[0]["commands_m"] if stairs else ()))
    runs = Column("runs monotone", lambda r: f"{r['monotone_runs']} of {r['runs']}")
    monotone = Column("monotone", lambda r: "yes" if r["monotone"] else "no")
    columns = (_CONTROLLER, *steps, monotone, runs, _SKIPPED)
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
    parts = [
        f"misses its command by {_mm(median(errors.values()))} in the median of"
        f" {len({row.command_m for row in rows})} heights and by {_mm(errors[worst])} at the worst,"
        f" {worst.command_m:.2f} m"
    ]
    if still := sorted({row.command_m for row in rows} - {row.command_m for row in errors}):
        parts.append(f"does not hop at {', '.join(f'{command:.2f}' for command in still)} m")
    parts += [_skipped(rows), _contacts(sum(row.body_contacts for row in rows))]
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


def _skipped(rows: Sequence[Summary]) -> str:
    skipped, hops = (sum(getattr(r, name) for r in rows) for name in ("skipped_hops", "hops"))
    return f"skips {skipped} of {skipped + hops} hops" if skipped else "skips no hop"


def _contacts(count: int) -> str:
    times = "once" if count == 1 else f"{count} times"
    return f"base or knee touch the ground {times}" if count else "only the foot touches the ground"


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
        console.print(f"{name} {verdict(evaluation, name)}", highlight=False)


def _print_notes(console: Console, notes: Sequence[str]) -> None:
    """Print what a reader must know before any table."""
    for note in notes:
        console.print(f"Note: {note}", highlight=False)


def print_robustness(console: Console, result: Row) -> None:
    """Print notes and the scores on every axis."""
    _print_notes(console, result["notes"])
    c, scores = result["conditions"], {(r["axis"], r["controller"]): r for r in result["scores"]}

    def score(controller: str) -> Column:
        def text(axis: str) -> str:
            row = scores[axis, controller]
            return f"{row['score']:.0%} [{row['low']:.0%}, {row['high']:.0%}]".replace("%", "")

        return Column(controller, text)

    columns = [Column("axis", str), *map(score, dict.fromkeys(name for _, name in scores))]
    title = (
        f"Robustness on {c['robot']}: successful trials in % and their 95 % interval;"
        f" {', '.join(f'{command:g}' for command in c['commands_m'])} m,"
        f" {c['seeds']} seeds from {c['seed']}."
    )
    axes = list(dict.fromkeys(axis for axis, _ in scores))
    _print_table(console, title, columns, axes)


def _print_table(
    console: Console, title: str, columns: Sequence[Column], rows: Sequence[Any]
) -> None:
    """Print a table under a sentence, within 80 columns where names allow."""
    console.print(title, highlight=False)
    shown = Table(box=box.SIMPLE_HEAD, padding=0)
    shown.add_column(columns[0].heading, min_width=14)
    for column in columns[1:]:
        shown.add_column(textwrap.fill(column.heading, _NARROW), justify="right")
    for row in rows:
        shown.add_row(*(column.text(row) for column in columns))
    print_table(shown, console)
