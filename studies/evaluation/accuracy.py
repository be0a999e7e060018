"""How near a controller's hops come to its commands, over all of an evaluation."""

import math
from collections.abc import Iterable, Mapping
from statistics import mean
from typing import Any


def accuracies(rows: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the accuracy of every controller of an evaluation's ``summary``, as JSON values.

    Errors are magnitudes of a command's median error, stds those of its apexes, m.
    """
    rows_of: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        rows_of.setdefault(row["controller"], []).append(row)
    return {name: _accuracy(own) for name, own in rows_of.items()}


def _accuracy(rows: list[Mapping[str, Any]]) -> dict[str, float]:
    errors = [abs(_known(row["median_error_m"])) for row in rows]
    spreads = [_known(row["std_m"]) for row in rows]
    flights = [row["flight_fraction"] for row in rows]
    return {
        "worst_error_m": max(errors),
        "mean_error_m": mean(errors),
        "worst_std_m": max(spreads),
        "mean_std_m": mean(spreads),
        "skipped_hops": sum(row["skipped_hops"] for row in rows),
        "body_contacts": sum(row["body_contacts"] for row in rows),
        "fewest_hops_per_s": min(row["hop_rate_hz"] for row in rows),
        "least_flight": min(flights),
        "mean_flight": mean(flights),
    }


def _known(value: float | None) -> float:
    """Return a length; infinity where there was no hop to measure it of."""
    return math.inf if value is None or math.isnan(value) else value
