"""Tables of how near hops come to their commands, and whether that is as near as was asked."""

from dataclasses import astuple
from statistics import median
from typing import Any

from macros_results import grid, number, origin, read

from hopping_leg.evaluate.acceptance import HIGHEST, LEAST_FLIGHT, LOWER, Accuracy, accuracies


def precision(file: str, high: float = 1.0) -> str:
    """Return how near hops come to commands of an evaluation: a row per controller, in mm.

    Args:
        file: In docs/results.
        high: The highest command that counts, m; up to ``HIGHEST`` the table also says whether
            all is as asked.
    """
    content, judged = read(file), high <= HIGHEST
    rows = [
        [name, *map(number, _cells(one)), *([number(one.as_asked)] if judged else [])]
        for name, one in accuracies(content["summary"], high).items()
    ]
    titles = [
        "controller", "worst error, mm", "mean", f"worst std up to {LOWER} m", "of all",
        "mean std", "skipped hops", "body contacts", "fewest hops/s", "least flight, %", "mean",
        *(["as asked"] if judged else []),
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
        found = accuracies(read(file)["summary"])
        near = [one for name, one in found.items() if name.startswith(begins)]
        spreads = [1e3 * one.mean_std_m for one in near]
        cells = [
            f"{sum(one.as_asked for one in near)} of {len(near)}",
            number(1e3 * max(one.worst_error_m for one in near)),
            *(number(of(spreads)) for of in (min, median, max)),
            number(1e3 * max(one.worst_std_m for one in near)),
            number([one.skipped_hops for one in near]),
            number(100 * min(one.least_flight for one in near)),
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
    flying = [command for command, row in other.items() if row["flight_fraction"] >= LEAST_FLIGHT]
    rows = []
    for name, mine in rows_of.items():
        cells = []
        for commands in (list(other), flying):
            for column in ("median_error_m", "std_m", "mean_abs_error_m"):
                nearer = [abs(mine[c][column]) < abs(other[c][column]) for c in commands]
                cells.append(f"{sum(nearer)} of {len(nearer)}")
        rows.append([name, *cells])
    measures = ("error smaller at", "std", "mean distance")
    half = f"where `{rival}` flies {100 * LEAST_FLIGHT:.0f} %"
    titles = ["controller", *measures, f"error, {half}", *(f"{m}, there" for m in measures[1:])]
    return grid(titles, rows) + origin(file, content)


def _cells(one: Accuracy) -> list[float]:
    """Return an accuracy's numbers in the order of a table's columns: mm, counts, 1/s, %."""
    values = astuple(one)
    return [*(1e3 * v for v in values[:5]), *values[5:8], *(100 * v for v in values[8:])]


MACROS = {"against": against, "precision": precision, "trainings": trainings}
