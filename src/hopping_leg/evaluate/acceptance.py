"""What is asked of accurate hops, and whether a controller's evaluation reaches it.

The limits hold for a leg of the paper's size at commands up to ``HIGHEST``.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import mean
from typing import Any

LOWER = 0.34
"""Commands up to which less scatter is asked for, m."""

HIGHEST = 0.40
"""Highest command of which accuracy is asked, m."""

LEAST_FLIGHT = 0.5
"""Least share of the time in flight that is asked for."""

AT_MOST = {
    "worst_error_m": 0.005,
    "mean_error_m": 0.003,
    "lower_std_m": 0.005,
    "worst_std_m": 0.008,
    "mean_std_m": 0.005,
    "skipped_hops": 0,
    "body_contacts": 0,
}
"""Upper limits of an ``Accuracy``."""

AT_LEAST = {"fewest_hops_per_s": 1.6, "least_flight": LEAST_FLIGHT}
"""Lower limits of an ``Accuracy``."""


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

    @property
    def shortfalls(self) -> list[str]:
        """What is not as asked, in words, each with its limit."""
        values = vars(self)
        over = [("most", n, limit) for n, limit in AT_MOST.items() if not values[n] <= limit]
        under = [("least", n, limit) for n, limit in AT_LEAST.items() if not values[n] >= limit]
        return [
            f"{name.removesuffix('_m').removesuffix('_per_s').replace('_', ' ')}"
            f" {_amount(name, values[name])} (asked: at {bound} {_amount(name, limit)})"
            for bound, name, limit in over + under
        ]

    @property
    def as_asked(self) -> bool:
        """Whether everything is within its limit."""
        return not self.shortfalls


def accuracies(rows: Iterable[Mapping[str, Any]], highest: float = HIGHEST) -> dict[str, Accuracy]:
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


def acceptance_lines(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a sentence per controller: whether its hops are as accurate as asked, or why not."""
    return [
        f"Accurate hops up to {HIGHEST:.2f} m, {name}:"
        f" {'as asked' if one.as_asked else 'not as asked: ' + ', '.join(one.shortfalls)}."
        for name, one in accuracies(rows).items()
    ]


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


def _amount(name: str, value: float) -> str:
    if name.endswith("_m"):
        return f"{1e3 * value:.1f} mm"
    if name.endswith("flight"):
        return f"{100 * value:.0f} %"
    return f"{value:.2f}/s" if name.endswith("_per_s") else f"{value:g}"
