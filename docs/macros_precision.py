"""Tables of how near hops come to their commands, and whether that is as near as was asked."""

from dataclasses import dataclass, fields
from statistics import mean, median
from typing import Any

from macros_results import grid, number, origin, read

_LOWER = 0.34
"""Commands up to which less scatter is asked for, m."""

_HIGHEST = 0.40
"""Highest command of which accuracy is asked, m."""

_FLIGHT = 0.5
"""Least share of the time in flight that is asked for."""


def precision(file: str, high: float = 1.0) -> str:
    """Return how near hops come to commands of an evaluation: a row per controller, in mm.

    Args:
        file: In docs/results.
        high: The highest command that counts, m; up to ``_HIGHEST`` the table also says whether
            all is as asked.
    """
    content = read(file)
    rows = [
        [name, *map(number, near.cells), *([number(near.as_asked)] if high <= _HIGHEST else [])]
        for name, near in _nearness(content, high).items()
    ]
    titles = [
        "controller", "worst error, mm", "mean", f"worst std up to {_LOWER} m", "of all",
        "mean std", "skipped hops", "hits", "fewest hops/s", "least flight, %", "mean",
        *(["as asked"] if high <= _HIGHEST else []),
    ]  # fmt: skip
    return grid(titles, rows) + origin(file, content)


def trainings(begins: str, files: dict[str, str]) -> str:
    """Return what several trainings of a recipe come to: a row per file, in mm.

    Args:
        begins: How the controllers that count are called.
        files: In docs/results, by what tells them apart.
    """
    rows = []
    for label, file in files.items():
        found = _nearness(read(file), _HIGHEST)
        near = [one for name, one in found.items() if name.startswith(begins)]
        spreads = [one.mean_std for one in near]
        cells = [
            f"{sum(one.as_asked for one in near)} of {len(near)}",
            number(max(one.worst_error for one in near)),
            *(number(of(spreads)) for of in (min, median, max)),
            number(max(one.worst_std for one in near)),
            number([one.skipped for one in near]),
            number(min(one.least_flight for one in near)),
        ]
        rows.append([label, *cells])
    titles = [
        "trainings", "as asked", "worst error, mm", "mean std: least", "median", "most",
        "worst std", "skipped hops", "least flight, %",
    ]  # fmt: skip
    return grid(titles, rows)


def against(file: str, rival: str) -> str:
    """Return at how many commands controllers are nearer than a rival: a row per controller.

    Of all commands, and of those at which the rival flies for half of the time, as asked of all.
    """
    content = read(file)
    rows_of: dict[str, dict[float, dict[str, Any]]] = {}
    for row in content["summary"]:
        rows_of.setdefault(row["controller"], {})[row["command_m"]] = row
    other = rows_of.pop(rival)
    flying = [command for command, row in other.items() if row["flight_fraction"] >= _FLIGHT]
    rows = []
    for name, mine in rows_of.items():
        cells = []
        for commands in (list(other), flying):
            for column in ("median_error_m", "std_m", "mean_abs_error_m"):
                nearer = [abs(mine[c][column]) < abs(other[c][column]) for c in commands]
                cells.append(f"{sum(nearer)} of {len(nearer)}")
        rows.append([name, *cells])
    measures = ("error smaller at", "std", "mean distance")
    half = f"where `{rival}` flies {100 * _FLIGHT:.0f} %"
    titles = ["controller", *measures, f"error, {half}", *(f"{m}, there" for m in measures[1:])]
    return grid(titles, rows) + origin(file, content)


@dataclass(frozen=True)
class _Near:
    """How near a controller's hops come to the commands, mm."""

    worst_error: float
    mean_error: float
    lower_std: float
    worst_std: float
    mean_std: float
    skipped: int
    hits: int
    fewest_hops: float
    least_flight: float
    mean_flight: float

    @property
    def cells(self) -> list[float]:
        """All of it, in the order of a table's columns."""
        return [getattr(self, field.name) for field in fields(self)]

    @property
    def as_asked(self) -> bool:
        """Whether it reaches what was asked of accurate hops at every command."""
        return (
            self.worst_error <= 5
            and self.mean_error <= 3
            and self.lower_std <= 5
            and self.worst_std <= 8
            and self.mean_std <= 5
            and self.skipped == self.hits == 0
            and self.fewest_hops >= 1.6
            and self.least_flight >= 100 * _FLIGHT
        )


def _nearness(content: dict[str, Any], high: float) -> dict[str, _Near]:
    """Return how near each controller of an evaluation is up to a command, m."""
    rows_of: dict[str, list[dict[str, Any]]] = {}
    for row in content["summary"]:
        if row["command_m"] <= high:
            rows_of.setdefault(row["controller"], []).append(row)
    return {name: _near(rows) for name, rows in rows_of.items()}


def _near(rows: list[dict[str, Any]]) -> _Near:
    errors = [1000 * abs(row["median_error_m"]) for row in rows]
    spreads = {row["command_m"]: 1000 * row["std_m"] for row in rows}
    return _Near(
        worst_error=max(errors),
        mean_error=mean(errors),
        lower_std=max(spread for command, spread in spreads.items() if command <= _LOWER),
        worst_std=max(spreads.values()),
        mean_std=mean(spreads.values()),
        skipped=sum(row["skipped_hops"] for row in rows),
        hits=sum(row["body_contacts"] for row in rows),
        fewest_hops=min(row["hop_rate_hz"] for row in rows),
        least_flight=100 * min(row["flight_fraction"] for row in rows),
        mean_flight=100 * mean(row["flight_fraction"] for row in rows),
    )


MACROS = {"against": against, "precision": precision, "trainings": trainings}
