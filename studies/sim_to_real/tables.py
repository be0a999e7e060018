"""Numbers of sim-to-real trials: per method over twins and seeds, with intervals over twins."""

import itertools
from collections.abc import Callable, Mapping, Sequence
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

    ``meanings`` are by the methods' names, the first of which the others are compared with;
    ``trials`` has a row per method, twin, seed and command. Of what is returned, ``rows`` has one
    per method and command, ``methods`` one per method, ``comparison`` the ratios of their errors.
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
        "methods": [
            {**_pooled(name, meaning, own), "ordered": sum(map(_ordered, _runs(own)))}
            for name, meaning in meanings.items()
            for own in [_of(trials, "method", name)]
        ],
        "comparison": [compare(first, other, trials) for other in others],
        "trials": list(trials),
        "notes": [note] if count < LEAST_TWINS else [],
    }


def median_over_twins(trials: Sequence[Row], name: str) -> Row:
    """Return the median of a number, in m, and its interval over twins and seeds."""
    median, low, high = _number([_cells(trials, name)], lambda of: float(np.median(of[0])))
    start = name.removesuffix("_m")
    return {name: median, f"{start}_low_m": low, f"{start}_high_m": high}


def compare(first: str, other: str, trials: Sequence[Row]) -> Row:
    """Return the ratio of two methods' errors.

    The medians are over all trials; the interval resamples whole twins, so that both methods keep
    meeting the same ones, and each method's seeds; it is NaN with fewer than ``LEAST_TWINS``.
    """
    errors = [_cells(_of(trials, "method", name), _ERROR) for name in (other, first)]
    numbers = _number(errors, lambda of: float(np.median(of[0]) / np.median(of[1])))
    ratios = dict(zip(("ratio", "ratio_low", "ratio_high"), numbers, strict=True))
    return {"method": other, "over": first, **ratios}


def _number(
    methods: Sequence[list[dict[Any, list[float]]]], statistic: Callable[[list[Array]], float]
) -> tuple[float, float, float]:
    """Return a statistic of methods' numbers and its interval; twins and seeds are resampled."""
    rng, twins = np.random.default_rng(_BOOTSTRAP_SEED), range(len(methods[0]))

    def drawn(index: Sequence[int]) -> float:
        return statistic([_drawn(cells, index, rng) for cells in methods])

    low, high = statistics.bootstrap(twins, drawn, _BOOTSTRAP_SEED, LEAST_TWINS)
    return statistic([_drawn(c, twins, None) for c in methods]), float(low), float(high)


def _pooled(name: str, meaning: str, trials: Sequence[Row]) -> Row:
    return {
        "method": name,
        "meaning": meaning,
        "policies": len(_runs(trials)),
        **median_over_twins(trials, _ERROR),
        "worst_abs_error_m": max(row[_ERROR] for row in trials),
        **{key: sum(row[key] for row in trials) for key in _SUMS},
    }


def _ordered(run: Sequence[Row]) -> bool:
    """Return whether a policy's median apex rises from every command to the next."""
    ranked = sorted(run, key=lambda row: float(row["command_m"]))
    apexes = [row["command_m"] + row["median_error_m"] for row in ranked]
    moves = not any(row["motionless"] for row in run)
    return moves and all(low < high for low, high in itertools.pairwise(apexes))


def _runs(trials: Sequence[Row]) -> list[list[Row]]:
    """Return the trials of each policy on each twin."""
    return [run for twin in _by("twin", trials).values() for run in _by("seed", twin).values()]


def _cells(trials: Sequence[Row], name: str) -> list[dict[Any, list[float]]]:
    """Return a number of every trial by twin and seed."""
    twins = [_by("seed", rows) for rows in _by("twin", trials).values()]
    return [{seed: [row[name] for row in run] for seed, run in of.items()} for of in twins]


def _drawn(
    cells: Sequence[dict[Any, list[float]]], index: Sequence[int], rng: np.random.Generator | None
) -> Array:
    """Return the numbers of some twins at all seeds, or at as many drawn ones, alike on all."""
    seeds = list(cells[0])
    seeds = seeds if rng is None else [seeds[k] for k in rng.integers(len(seeds), size=len(seeds))]
    return np.concatenate([cells[i][seed] for i in index for seed in seeds])


def _of(trials: Sequence[Row], key: str, value: object) -> list[Row]:
    return [row for row in trials if row[key] == value]


def _by(key: str, trials: Sequence[Row]) -> dict[Any, list[Row]]:
    groups: dict[Any, list[Row]] = {}
    for row in trials:
        groups.setdefault(row[key], []).append(row)
    return groups
