"""What the loader rejects, and what it leaves out and warns about.

A check takes what is known so far and either raises, or returns the table without what cannot be
believed. Rows in messages are those of the file, the first below the header being 0.
"""

from collections.abc import Callable

import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.clock import check_clock, warn_of_stalls
from hopping_leg.identify.columns import PAIRS
from hopping_leg.identify.inspection import Inspection
from hopping_leg.identify.repairs import drop_garbage, drop_startup, drop_zeros
from hopping_leg.identify.units import check_units
from hopping_leg.identify.velocity import check_velocity

LEAST_ROWS = 20
"""Rows with a position that a recording needs."""

LEAST_MOTION = 0.02
"""Motion of the joint that moves more, rad; below it nothing can be identified."""

SMALL_MOTION = 0.5
"""Below it, rad, positions may be revolutions."""


def check_table(inspection: Inspection) -> tuple[pl.DataFrame, list[str]]:
    """Return a table that can be believed, and a sentence for each thing that was strange.

    Raises:
        RecordingError: Naming file, column and row.
    """
    for check in _CHECKS:
        inspection.table = check(inspection)
    return inspection.table, inspection.warnings


def _check_columns(inspection: Inspection) -> pl.DataFrame:
    table = inspection.table
    if table.height == 0:
        raise RecordingError(f"{inspection.origin} has no rows below its header; record again.")
    if "time_s" not in table.columns:
        raise RecordingError(
            f"{inspection.origin} has no column 'time_s'; a recording needs time and position."
        )
    return table


def _check_motion(inspection: Inspection) -> pl.DataFrame:
    """Refuse what is too short or at rest."""
    table, origin = inspection.table, inspection.origin
    spans = {}
    for column in PAIRS["position"]:
        values = inspection.values(column).drop_nulls()
        if values.len() >= LEAST_ROWS:
            spans[column] = float(values.max()) - float(values.min())  # type: ignore[arg-type]
        elif column not in table.columns or values.len() == 0:
            inspection.warn(f"{inspection.named(column)} was not recorded")
    if not spans:
        raise RecordingError(
            f"{origin} is too short: {table.height} rows, and no joint has {LEAST_ROWS} positions"
            f" ({' or '.join(map(inspection.named, PAIRS['position']))})."
        )
    widest = max(spans, key=lambda column: spans[column])
    if spans[widest] < LEAST_MOTION:
        raise RecordingError(
            f"{origin} is at rest: {inspection.named(widest)} spans {spans[widest]:.2g} rad;"
            f" nothing can be identified below {LEAST_MOTION:g} rad, play an excitation."
        )
    if spans[widest] < SMALL_MOTION:
        inspection.warn(
            f"{inspection.named(widest)} spans only {spans[widest]:.2g}; check that it is in rad,"
            " not in revolutions"
        )
    return table


_CHECKS: tuple[Callable[[Inspection], pl.DataFrame], ...] = (
    _check_columns,
    check_clock,
    drop_garbage,
    drop_zeros,
    drop_startup,
    check_units,
    check_velocity,
    _check_motion,
    warn_of_stalls,
)
