"""How far, how different, and how sure: the one place where samples become statements.

Hops of one run depend on each other, runs with seeds of their own do not: tests are made per run
and combined, and intervals resample runs, twins or policies, whatever was drawn independently.
Nothing that failed is dropped: a run without a hop enters as misses, see ``metrics.errors_of``.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from hopping_leg.arrays import Array

_TAILS = (2.5, 97.5)  # of a 95 % interval, percent
RESAMPLES = 1000


def of(statistic: Callable[[Array], Any], values: Array) -> float:
    """Return a statistic of values, NaN where there are none."""
    return float(statistic(values)) if len(values) else math.nan


def bootstrap(
    units: Sequence[Any], statistic: Callable[[list[Any]], Any], seed: int, least: int = 2
) -> Array:
    """Return 95 % percentile intervals of a statistic, (2,) or (2, values); units are resampled.

    Units are what was drawn independently: runs, twins, policies, each with all of its values. The
    statistic of a list of them is a number, or several; of less than ``least`` it is unknown, NaN.
    """
    if len(units) < least:
        return np.full((2, *np.shape(statistic(list(units)))), np.nan)
    rng = np.random.default_rng(seed)
    draws = rng.integers(len(units), size=(RESAMPLES, len(units)))
    values = np.array([statistic([units[i] for i in draw]) for draw in draws])
    interval: Array = np.percentile(values, _TAILS, axis=0)
    return interval


def median_interval(runs: Sequence[Array], seed: int, least: int = 2) -> tuple[float, float]:
    """Return the bootstrap interval of the median over all values, runs, (values,), resampled."""
    filled = [run for run in runs if len(run)]
    if not filled:
        return math.nan, math.nan
    low, high = bootstrap(filled, lambda drawn: np.median(np.concatenate(drawn)), seed, least)
    return float(low), float(high)


def share_interval(scores: Array, seed: int) -> tuple[float, float]:
    """Return the 95 % interval of a mean score, given one per realisation, 0 to 1, (n,).

    It is a Bayesian bootstrap: realisations get random weights, beside Jeffreys' half a success and
    half a failure, so that a few realisations that agree do not pass for certainty. For scores of 0
    and 1 it is Jeffreys' interval of a share.
    """
    rng, mean = np.random.default_rng(seed), scores.mean()
    weights = rng.dirichlet([*np.ones(len(scores)), 0.5, 0.5], 4 * RESAMPLES)
    low, high = np.percentile(weights @ np.append(scores, [0.0, 1.0]), _TAILS)
    return float(min(low, mean)), float(max(high, mean))


@dataclass(frozen=True)
class Neighbours:
    """Two neighbouring commands compared, as in the paper's Fig. 9."""

    lower_m: float
    upper_m: float
    runs: int
    """Pairs of runs with hops at both commands; a run that asks for both is its own pair."""
    p: float
    """P-value, two-sided: Wilcoxon rank-sum test of each pair of runs, combined by Stouffer."""
    cliffs_delta: float
    """P(upper > lower) - P(upper < lower) over the hops of a pair of runs, mean over pairs; 1 is
    full separation in order."""
    cliffs_delta_low: float
    """Lower end of its 95 % bootstrap interval, pairs of runs resampled."""
    cliffs_delta_high: float
    overlap: float
    """Share of all hops between the smallest of the higher and the largest of the lower command."""
    pooled_p: float
    """The paper's own number: one rank-sum test of all hops, as if none depended on another."""


def compare(
    lower_m: float, lower: Sequence[Array], upper_m: float, upper: Sequence[Array], seed: int
) -> Neighbours:
    """Compare the apexes, m, (hops,), of each run at two commands, m.

    Runs of ``upper`` stand beside those that they are compared with; the seed is the bootstrap's.
    """
    pairs = [(a, b) for a, b in zip(lower, upper, strict=True) if len(a) and len(b)]
    if not pairs:
        return Neighbours(lower_m, upper_m, 0, *6 * (math.nan,))
    below, above = (np.concatenate(side) for side in zip(*pairs, strict=True))
    both = np.concatenate([below, above])
    between = (both >= above.min()) & (both <= below.max())
    deltas = [cliffs_delta(*pair) for pair in pairs]
    scores = [stats.ranksums(b, a).statistic for a, b in pairs]  # normal, direction kept
    low, high = bootstrap(deltas, np.mean, seed)
    return Neighbours(
        lower_m=lower_m, upper_m=upper_m, runs=len(pairs), overlap=float(between.mean()),
        p=float(2 * stats.norm.sf(abs(np.sum(scores)) / math.sqrt(len(scores)))),
        cliffs_delta=float(np.mean(deltas)), cliffs_delta_low=float(low),
        cliffs_delta_high=float(high), pooled_p=float(stats.ranksums(above, below).pvalue),
    )  # fmt: skip


def cliffs_delta(lower: Array, upper: Array) -> float:
    """Return Cliff's delta, -1 to 1; 1 when every value of ``upper`` exceeds all of ``lower``."""
    u = stats.mannwhitneyu(upper, lower, method="asymptotic").statistic
    return float(2 * u / (len(lower) * len(upper)) - 1)
