"""Results as tables, in HTML for pages and in text for the terminal; lengths in mm."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

from markupsafe import Markup
from rich import box
from rich.console import Console
from rich.table import Table

from hopping_leg.evaluate.result import Comparison, Estimator, Evaluation, Group, Staircase, Summary
from hopping_leg.html_page import Column, table
from hopping_leg.terminal import print_table


def millimetres(value: float, sign: bool = False) -> str:
    """Return a length in mm; a dash where there is none."""
    return f"{1e3 * value:{'+' if sign else ''}z.1f}" if value == value else "-"


def column(
    heading: str,
    name: str,
    form: str = "",
    scale: float = 1.0,
    unit: str = "",
    bad: Callable[[Any], bool] = lambda _value: False,
) -> Column:
    """Return the column of an entry of rows, be they dataclasses or JSON values."""

    def entry(row: Any) -> Any:  # noqa: ANN401
        return row[name] if isinstance(row, dict) else getattr(row, name)

    def text(row: Any) -> str:  # noqa: ANN401
        value = entry(row)
        if value is None or value != value:
            return "-"
        return format(value * scale if scale != 1 else value, form) + unit

    return Column(heading, text, lambda row: bad(entry(row)))


def _percent(heading: str, name: str) -> Column:
    return column(heading, name, ".0f", 100, " %")


def _interval(row: Summary | Group) -> str:
    low = millimetres(row.median_error_low_m, sign=True)
    return f"{low} to {millimetres(row.median_error_high_m, sign=True)}"


def _positive(value: float | None) -> bool:
    return value is not None and value > 0


_CONTROLLER = column("controller", "controller")
_COMMAND = column("command / m", "command_m", ".2f")
_ERROR = column("median error / mm", "median_error_m", "+z.1f", 1e3)
_INTERVAL = Column("95 % interval / mm", _interval)
_STD = column("std / mm", "std_m", ".1f", 1e3)
_HOPS = column("hops", "hops")
_SKIPPED = column("skipped", "skipped_hops", bad=_positive)
_CONTACTS = column("body contacts", "body_contacts", bad=_positive)

SUMMARY = (
    _CONTROLLER,
    _COMMAND,
    _ERROR,
    _INTERVAL,
    _STD,
    column("IQR / mm", "iqr_m", ".1f", 1e3),
    _HOPS,
    _SKIPPED,
    column("hops / s", "hop_rate_hz", ".2f"),
    column("flight / %", "flight_fraction", ".0f", 100),
    column("sink / mm", "max_sink_m", ".0f", 1e3),
    column("lowest base / mm", "min_base_height_m", ".0f", 1e3),
    _CONTACTS,
)

LOAD = (
    _CONTROLLER,
    _COMMAND,
    column("peak hip / N m", "peak_hip_torque_nm", ".1f"),
    column("peak knee / N m", "peak_knee_torque_nm", ".1f"),
    column("RMS hip / N m", "rms_hip_torque_nm", ".1f"),
    column("RMS knee / N m", "rms_knee_torque_nm", ".1f"),
    column("RMS of rated / %", "rated_torque_share", ".0f", 100, bad=lambda share: share > 1),
    Column(
        "limited after / min",
        lambda r: f"{r.thermal_minutes:.1f}" if math.isfinite(r.thermal_minutes) else "-",
    ),
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

LADDER = (_CONTROLLER, _COMMAND, _ERROR, _STD, _HOPS, _SKIPPED, _CONTACTS)

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

_SHORT = (
    _CONTROLLER,
    column("cmd", "command_m", ".0f", 1e3),
    column("error", "median_error_m", "+z.1f", 1e3),
    column("std", "std_m", ".1f", 1e3),
    _HOPS,
    column("skip", "skipped_hops"),
    column("1/s", "hop_rate_hz", ".2f"),
    _percent("flight", "flight_fraction"),
    column("base", "min_base_height_m", ".0f", 1e3),
    column("contacts", "body_contacts"),
    _percent("out", "outside_limits_fraction"),
)


def neighbour_table(comparisons: Sequence[Comparison]) -> Markup:
    """Return the tests between neighbouring commands."""
    p = column("", "p", ".3f")
    low, high = (column("", f"cliffs_delta_{end}", "+.3f") for end in ("low", "high"))
    columns = (
        _CONTROLLER,
        Column("commands / m", lambda r: f"{r['lower_m']:.2f} and {r['upper_m']:.2f}"),
        Column(
            "p, rank sums of runs",
            lambda r: "< 0.001" if r["p"] < 1e-3 else p.text(r),
            lambda r: not r["p"] < 1e-3,
        ),
        column("Cliff's delta", "cliffs_delta", "+.3f"),
        Column("95 % interval", lambda r: f"{low.text(r)} to {high.text(r)}"),
        column("hops in the overlap", "overlap", ".1f", 100, " %"),
    )
    return table(
        columns,
        [{"controller": c.controller, **vars(n)} for c in comparisons for n in c.neighbours],
    )


def staircase_table(stairs: Sequence[Staircase]) -> Markup:
    """Return medians per step and what follows from them, a table per set of steps."""
    sets: dict[tuple[float, ...], list[Staircase]] = {}
    for one in stairs:
        sets.setdefault(tuple(one.commands_m), []).append(one)

    def step(index: int, command: float) -> Column:
        return Column(f"{command:.2f} m", lambda row: millimetres(row.median_apexes_m[index]))

    last = (
        Column("monotone", lambda r: "yes" if r.monotone else "no", lambda r: not r.monotone),
        Column("runs monotone", lambda r: f"{r.monotone_runs} of {r.runs}"),
        _SKIPPED,
    )
    return Markup("").join(
        table(
            (_CONTROLLER, *itertools.starmap(step, enumerate(steps)), *last),
            rows,
            "median apex at each step / mm",
        )
        for steps, rows in sets.items()
    )


def estimator_table(estimators: Sequence[Estimator]) -> Markup:
    """Return bias and spread of estimated minus true height."""

    def pair(heading: str, name: str) -> Column:
        bias = column("", f"{name}_bias_m", "+z.1f", 1e3)
        std = column("", f"{name}_std_m", ".1f", 1e3)
        return Column(heading, lambda row: f"{bias.text(row)} ± {std.text(row)}")

    columns = (
        _CONTROLLER,
        pair("in flight / mm", "flight"),
        pair("in stance / mm", "stance"),
        pair("apex, after landing / mm", "apex"),
        _HOPS,
    )
    return table(columns, estimators, "estimated minus true, mean ± standard deviation")


def print_evaluation(console: Console, evaluation: Evaluation) -> None:
    """Print notes, the summary, and what it was measured on."""
    _print_notes(console, evaluation.notes)
    for one in filter(None, (evaluation, evaluation.secondary)):
        c = one.conditions
        title = (
            f"{c['robot']}, {c['floor']} floor, {c['seeds']} seed{'' if c['seeds'] == 1 else 's'}"
            f" from {c['seed']}; heights in mm"
        )
        caption = (
            "error: median of apex - command; skip: skipped hops; 1/s: hop rate;\n"
            "base: lowest height over whole runs; contacts: of base or knee with the ground;\n"
            "out: time with a joint outside its soft limits"
        )
        print_table(_text_table(_SHORT, one.summary, title, caption), console)
    lines = [
        f"Staircase, {step.controller}: {'rises' if step.monotone else 'does not rise'} at every"
        f" step ({step.monotone_runs} of {step.runs} runs on their own), {step.skipped_hops}"
        " skipped hops."
        for step in evaluation.staircase
    ]
    own = [evaluation.rows(name) for name in evaluation.controllers]
    lines += [_load_line(rows) for rows in own if math.isfinite(rows[0].rated_torque_share)]
    for line in lines:
        console.print(line, highlight=False)


def _print_notes(console: Console, notes: Sequence[str]) -> None:
    """Print what a reader must know before any table."""
    for note in notes:
        console.print(f"Note: {note}", highlight=False)


def _load_line(rows: Sequence[Summary]) -> str:
    """Return what a controller asks of the motors at worst, of all its commands."""
    share, minutes = (max(r.rated_torque_share for r in rows), min(r.thermal_minutes for r in rows))
    limited = f"limited after {minutes:.1f} min" if share > 1 else "never limited by heat"
    return (
        f"Motors, {rows[0].controller}: RMS torque {100 * share:.0f} % of the rated ({limited}),"
        f" {max(r.mean_electrical_power_w for r in rows):.0f} W from the bus, up to"
        f" {max(r.peak_regeneration_w for r in rows):.0f} W back"
        f" (+{max(r.bus_voltage_rise_v for r in rows):.2f} V),"
        f" {max(r.torque_reversals_hz for r in rows):.0f} torque reversals per s."
    )


def print_robustness(console: Console, result: dict[str, Any]) -> None:
    """Print notes and the scores on every axis."""
    _print_notes(console, result["notes"])
    c = result["conditions"]
    marked = {axis["name"]: bool(axis["leaderboard"]) for axis in result["axes"]}
    scores = {(row["controller"], row["axis"]): _score(row) for row in result["scores"]}
    axes = list(dict.fromkeys(axis for _, axis in scores))

    def score(controller: str) -> Column:
        return Column(controller, lambda axis: scores[controller, axis])

    columns = [Column("axis", str), Column("R", lambda axis: "x" if marked.get(axis) else "")]
    columns += map(score, dict.fromkeys(name for name, _ in scores))
    title = f"Robustness, {c['robot']}: successful trials in %"
    caption = (
        f"{', '.join(f'{command:g}' for command in c['commands_m'])} m, {c['seeds']} seeds from"
        f" {c['seed']}; in brackets the 95 % interval;\nR: on RealAIGym's leaderboard, too"
    )
    print_table(_text_table(columns, axes, title, caption), console)


def _score(row: dict[str, Any]) -> str:
    score = f"{100 * row['score']:.0f}"
    if not math.isfinite(row["low"]):
        return score
    return f"{score} [{100 * row['low']:.0f}, {100 * row['high']:.0f}]"


def _text_table(
    columns: Sequence[Column], rows: Sequence[Any], title: str, caption: str | None = None
) -> Table:
    """Return a table for the terminal, within 80 columns where names allow."""
    shown = Table(title=title, caption=caption, box=box.SIMPLE_HEAD, padding=0)
    shown.add_column(columns[0].heading, min_width=14)
    for column in columns[1:]:
        shown.add_column(column.heading, justify="right")
    for row in rows:
        shown.add_row(*(column.text(row) for column in columns))
    return shown
