"""Numbers of sim-to-real trials: per method over twins and seeds, with intervals over twins."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate import statistics
from studies.shared import Row
from studies.sim_to_real.twins import LEAST_TWINS

_BOOTSTRAP_SEED = 0
_ERROR = "median_abs_error_m"
_SUMS = ("hops", "skipped_hops", "missed_runs", "body_contacts", "motionless")


def tabulate(meanings: Mapping[str, str], trials: Sequence[Row]) -> Row:
    """Return medians over twins and seeds, as JSON values.

    Args:
        meanings: By the methods' names; the others are compared with the first.
        trials: One row per method, twin, seed and command.

    Returns:
        ``rows`` has one per method and command, ``methods`` one per method, ``comparison`` the
        ratios of the methods' errors; ``trials`` are the trials.
    """
    rows = []
    for name, meaning in meanings.items():
        for command, tried in _by("command_m", _of(trials, "method", name)).items():
            stds = [row["std_m"] for row in tried if row["hops"]]
            rows.append({
                **_pooled(name, meaning, tried),
                "command_m": command,
                **median_over_twins(tried, "median_error_m"),
                "median_std_m": float(np.median(stds or [np.nan])),
            })  # fmt: skip
    first, *others = meanings
    count = len(_by("twin", trials))
    note = f"{count} twins are too few for intervals over twins; give {LEAST_TWINS} or more."
    return {
        "rows": rows,
        "methods": [_whole(n, m, _of(trials, "method", n)) for n, m in meanings.items()],
        "comparison": [compare(first, other, trials) for other in others],
        "trials": list(trials),
        "notes": [note] if count < LEAST_TWINS else [],
    }


def median_over_twins(trials: Sequence[Row], name: str) -> Row:
    """Return the median of a number, in m, and its interval over the twins."""
    numbers = _of_twins(trials, name)
    low, high = statistics.median_interval(numbers, _BOOTSTRAP_SEED, LEAST_TWINS)
    start = name.removesuffix("_m")
    median = float(np.median(np.concatenate(numbers)))
    return {name: median, f"{start}_low_m": low, f"{start}_high_m": high}


def compare(first: str, other: str, trials: Sequence[Row]) -> Row:
    """Return the ratio of two methods' errors.

    The medians are over all trials; the interval resamples whole twins, so that both methods keep
    meeting the same ones; it is NaN with fewer than ``LEAST_TWINS``.
    """
    below, above = (_of(trials, "method", name) for name in (first, other))
    errors = [_of_twins(rows, _ERROR) for rows in (above, below)]
    count = len(errors[0])

    def ratio(index: Sequence[int]) -> float:
        over, under = (np.median(np.concatenate([of[i] for i in index])) for of in errors)
        return float(over / under)

    low, high = statistics.bootstrap(range(count), ratio, _BOOTSTRAP_SEED, LEAST_TWINS)
    return {
        "method": other,
        "over": first,
        "ratio": ratio(range(count)),
        "ratio_low": float(low),
        "ratio_high": float(high),
    }


def _pooled(name: str, meaning: str, trials: Sequence[Row]) -> Row:
    return {
        "method": name,
        "meaning": meaning,
        "policies": len(_runs(trials)),
        **median_over_twins(trials, _ERROR),
        "worst_abs_error_m": max(row[_ERROR] for row in trials),
        **{key: sum(row[key] for row in trials) for key in _SUMS},
    }


def _whole(name: str, meaning: str, trials: Sequence[Row]) -> Row:
    ordered = sum(map(_ordered, _runs(trials)))
    return {**_pooled(name, meaning, trials), "ordered": ordered}


def _ordered(run: Sequence[Row]) -> bool:
    """Return whether a policy's median apex rises from every command to the next."""
    ranked = sorted(run, key=lambda row: float(row["command_m"]))
    apexes = [row["command_m"] + row["median_error_m"] for row in ranked]
    moves = not any(row["motionless"] for row in run)
    return moves and all(low < high for low, high in itertools.pairwise(apexes))


def _runs(trials: Sequence[Row]) -> list[list[Row]]:
    """Return the trials of each policy on each twin."""
    return [run for twin in _by("twin", trials).values() for run in _by("seed", twin).values()]


def _of_twins(trials: Sequence[Row], name: str) -> list[Array]:
    """Return a number of every trial, one array per twin."""
    return [np.array([row[name] for row in rows]) for rows in _by("twin", trials).values()]


def _of(trials: Sequence[Row], key: str, value: object) -> list[Row]:
    return [row for row in trials if row[key] == value]


def _by(key: str, trials: Sequence[Row]) -> dict[Any, list[Row]]:
    groups: dict[Any, list[Row]] = {}
    for row in trials:
        groups.setdefault(row[key], []).append(row)
    return groups
