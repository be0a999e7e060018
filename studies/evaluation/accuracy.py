"""How near a controller's hops come to its commands, over all of an evaluation."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import mean
from typing import Any

LOWER = 0.34
"""Commands up to which less scatter is asked for, m."""


@dataclass(frozen=True)
class Accuracy:
    """How near a controller's hops come to its commands."""

    worst_error_m: float
    """Largest magnitude of the median error of a command."""
    mean_error_m: float
    lower_std_m: float
    """Largest standard deviation of the apexes at commands up to ``LOWER``."""
    worst_std_m: float
    mean_std_m: float
    skipped_hops: int
    body_contacts: int
    fewest_hops_per_s: float
    least_flight: float
    """Smallest share of the time in flight at a command."""
    mean_flight: float


def accuracies(rows: Iterable[Mapping[str, Any]], highest: float) -> dict[str, Accuracy]:
    """Return the accuracy of every controller of an evaluation, at commands up to ``highest``, m.

    ``rows`` are its ``summary``, as JSON values.
    """
    rows_of: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["command_m"] <= highest:
            rows_of.setdefault(row["controller"], []).append(row)
    return {name: _accuracy(own) for name, own in rows_of.items()}


def _accuracy(rows: list[Mapping[str, Any]]) -> Accuracy:
    errors = [abs(_known(row["median_error_m"])) for row in rows]
    spreads = [_known(row["std_m"]) for row in rows]
    lower = [s for s, row in zip(spreads, rows, strict=True) if row["command_m"] <= LOWER]
    flights = [row["flight_fraction"] for row in rows]
    return Accuracy(
        max(errors), mean(errors), max(lower, default=0.0), max(spreads), mean(spreads),
        sum(row["skipped_hops"] for row in rows), sum(row["body_contacts"] for row in rows),
        min(row["hop_rate_hz"] for row in rows), min(flights), mean(flights),
    )  # fmt: skip


def _known(value: float | None) -> float:
    """Return a length; infinity where there was no hop to measure it of."""
    return math.inf if value is None or math.isnan(value) else value
