"""Tables of the report as HTML; lengths in mm."""

from collections.abc import Callable, Sequence

from markupsafe import Markup

from hopping_leg.evaluate.result import Comparison, Estimator, Group, Staircase, Summary
from hopping_leg.evaluate.statistics import Neighbours
from hopping_leg.html_page import Column, table


def millimetres(value: float, sign: bool = False) -> str:
    """Return a length in mm; a dash where there is none."""
    if value != value:
        return "-"
    return f"{1e3 * value:{'+' if sign else ''}.1f}"


def small(p: float) -> str:
    """Return a p-value."""
    if p != p:
        return "-"
    return "< 0.001" if p < 1e-3 else f"{p:.3f}"


def _interval(row: Summary | Group) -> str:
    low = millimetres(row.median_error_low_m, sign=True)
    return f"{low} .. {millimetres(row.median_error_high_m, sign=True)}"


def summary_table(rows: Sequence[Summary], caption: str = "") -> Markup:
    """Return the main table."""
    return table(
        [
            Column("controller", lambda r: r.controller),
            Column("command / m", lambda r: f"{r.command_m:.2f}"),
            Column("median error / mm", lambda r: millimetres(r.median_error_m, sign=True)),
            Column("95 % interval", _interval),
            Column("std / mm", lambda r: millimetres(r.std_m)),
            Column("IQR / mm", lambda r: millimetres(r.iqr_m)),
            Column("hops", lambda r: f"{r.hops}"),
            Column("skipped", lambda r: f"{r.skipped_hops}", lambda r: r.skipped_hops > 0),
            Column("hops/s", lambda r: f"{r.hop_rate_hz:.2f}"),
            Column("flight", lambda r: f"{100 * r.flight_fraction:.0f} %"),
            Column("lowest base / mm", lambda r: f"{1e3 * r.min_base_height_m:.0f}"),
            Column("sink / mm", lambda r: f"{1e3 * r.max_sink_m:.0f}"),
            Column("body contacts", lambda r: f"{r.body_contacts}", lambda r: r.body_contacts > 0),
            Column(
                "peak torque hip, knee / N m",
                lambda r: f"{r.peak_hip_torque_nm:.1f}, {r.peak_knee_torque_nm:.1f}",
            ),
            Column("RMS", lambda r: f"{r.rms_hip_torque_nm:.1f}, {r.rms_knee_torque_nm:.1f}"),
        ],
        rows,
        caption,
    )


def ladder_table(rows: Sequence[Summary]) -> Markup:
    """Return the ladder in short form."""
    return table(
        [
            Column("controller", lambda r: r.controller),
            Column("command / m", lambda r: f"{r.command_m:.2f}"),
            Column("median error / mm", lambda r: millimetres(r.median_error_m, sign=True)),
            Column("std / mm", lambda r: millimetres(r.std_m)),
            Column("hops", lambda r: f"{r.hops}"),
            Column("skipped", lambda r: f"{r.skipped_hops}", lambda r: r.skipped_hops > 0),
            Column("body contacts", lambda r: f"{r.body_contacts}", lambda r: r.body_contacts > 0),
        ],
        rows,
    )


def neighbour_table(comparisons: Sequence[Comparison]) -> Markup:
    """Return the tests between neighbouring commands."""
    rows: list[tuple[str, Neighbours]] = [
        (c.controller, neighbours) for c in comparisons for neighbours in c.neighbours
    ]
    return table(
        [
            Column("controller", lambda r: r[0]),
            Column("commands / m", lambda r: f"{r[1].lower_m:.2f} and {r[1].upper_m:.2f}"),
            Column("p, rank sum", lambda r: small(r[1].p), lambda r: not r[1].p < 1e-3),
            Column(
                "Cliff's delta",
                lambda r: f"{r[1].cliffs_delta:+.3f}" if r[1].p == r[1].p else "-",
            ),
            Column(
                "hops in the overlap",
                lambda r: f"{100 * r[1].overlap:.1f} %" if r[1].p == r[1].p else "-",
            ),
        ],
        rows,
    )


def staircase_table(stairs: Sequence[Staircase]) -> Markup:
    """Return medians per step and what follows from them."""
    commands = stairs[0].commands_m if stairs else []
    steps = [Column(f"{command:.2f} m", _step_text(i)) for i, command in enumerate(commands)]
    return table(
        [
            Column("controller", lambda r: r.controller),
            *steps,
            Column("monotone", lambda r: "yes" if r.monotone else "no", lambda r: not r.monotone),
            Column("runs monotone", lambda r: f"{r.monotone_runs} of {r.runs}"),
            Column("skipped", lambda r: f"{r.skipped_hops}", lambda r: r.skipped_hops > 0),
        ],
        stairs,
        "median apex at each step / mm",
    )


def _step_text(index: int) -> Callable[[Staircase], str]:
    return lambda staircase: millimetres(staircase.median_apexes_m[index])


def group_table(groups: Sequence[Group]) -> Markup:
    """Return the aggregate over training seeds."""
    return table(
        [
            Column("group", lambda r: r.group),
            Column("command / m", lambda r: f"{r.command_m:.2f}"),
            Column("policies", lambda r: f"{r.policies}"),
            Column("never hopped", lambda r: f"{r.motionless}", lambda r: r.motionless > 0),
            Column("median error / mm", lambda r: millimetres(r.median_error_m, sign=True)),
            Column("95 % interval", _interval),
            Column("worst |error| / mm", lambda r: millimetres(r.worst_abs_error_m)),
            Column("median std / mm", lambda r: millimetres(r.median_std_m)),
            Column("skipped", lambda r: f"{r.skipped_hops}", lambda r: r.skipped_hops > 0),
            Column("body contacts", lambda r: f"{r.body_contacts}", lambda r: r.body_contacts > 0),
        ],
        groups,
    )


def estimator_table(estimators: Sequence[Estimator]) -> Markup:
    """Return bias and spread of estimated minus true height."""

    def pair(bias: float, std: float) -> str:
        return f"{millimetres(bias, sign=True)} +- {millimetres(std)}"

    return table(
        [
            Column("controller", lambda r: r.controller),
            Column("in flight / mm", lambda r: pair(r.flight_bias_m, r.flight_std_m)),
            Column("in stance / mm", lambda r: pair(r.stance_bias_m, r.stance_std_m)),
            Column("apex, after landing / mm", lambda r: pair(r.apex_bias_m, r.apex_std_m)),
            Column("hops", lambda r: f"{r.hops}"),
        ],
        estimators,
        "estimated minus true, mean +- standard deviation",
    )
