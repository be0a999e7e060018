"""How near a controller's hops come to its commands, over all of an evaluation."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import mean
from typing import Any

LOWER = 0.34
"""Commands up to which less scatter is asked for, m."""

LEAST_FLIGHT = 0.5
"""Share of the time in flight at which energy shaping is compared."""


@dataclass(frozen=True)
class Accuracy:
    """How near a controller's hops come to its commands."""

    worst_error_m: float
    """Largest magnitude of the median error of a command."""
    mean_error_m: float
    """Mean magnitude of the median errors."""
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
    """Return the accuracy of every controller of an evaluation.

    Args:
        rows: An evaluation's ``summary``, as JSON values.
        highest: Commands above this do not count, m.
    """
    rows_of: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["command_m"] <= highest:
            rows_of.setdefault(row["controller"], []).append(row)
    return {name: _accuracy(own) for name, own in rows_of.items()}


def _accuracy(rows: list[Mapping[str, Any]]) -> Accuracy:
    errors = [abs(_known(row["median_error_m"])) for row in rows]
    spreads = {row["command_m"]: _known(row["std_m"]) for row in rows}
    return Accuracy(
        worst_error_m=max(errors),
        mean_error_m=mean(errors),
        lower_std_m=max((s for c, s in spreads.items() if c <= LOWER), default=0.0),
        worst_std_m=max(spreads.values()),
        mean_std_m=mean(spreads.values()),
        skipped_hops=sum(row["skipped_hops"] for row in rows),
        body_contacts=sum(row["body_contacts"] for row in rows),
        fewest_hops_per_s=min(row["hop_rate_hz"] for row in rows),
        least_flight=min(row["flight_fraction"] for row in rows),
        mean_flight=mean(row["flight_fraction"] for row in rows),
    )


def _known(value: float | None) -> float:
    """Return a length; infinity where there was no hop to measure it of."""
    return math.inf if value is None or math.isnan(value) else value
