"""Are the heights different, by how much, and how sure is that?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from hopping_leg.arrays import Array, IntArray

CONFIDENCE = 0.95
RESAMPLES = 1000


def of(statistic: Callable[[Array], Any], values: Array) -> float:
    """Return a statistic of values, NaN where there are none."""
    return float(statistic(values)) if len(values) else float("nan")


@dataclass(frozen=True)
class Neighbours:
    """Two neighbouring commands compared, as in the paper's Fig. 9."""

    lower_m: float
    """The lower command, m."""
    upper_m: float
    """The higher command, m."""
    p: float
    """P-value of the two-sided Wilcoxon rank-sum test, normal approximation."""
    cliffs_delta: float
    """P(upper > lower) - P(upper < lower) over all pairs of hops; 1 is full separation in order."""
    overlap: float
    """Share of all hops between the smallest of the higher and the largest of the lower command."""


def compare(lower_m: float, lower: Array, upper_m: float, upper: Array) -> Neighbours:
    """Compare the apexes, m, (hops,) each, of two commands, m."""
    if not len(lower) or not len(upper):
        return Neighbours(lower_m, upper_m, float("nan"), float("nan"), float("nan"))
    both = np.concatenate([lower, upper])
    between = (both >= upper.min()) & (both <= lower.max())
    p = float(stats.ranksums(lower, upper).pvalue)
    return Neighbours(lower_m, upper_m, p, cliffs_delta(lower, upper), float(between.mean()))


def cliffs_delta(lower: Array, upper: Array) -> float:
    """Return Cliff's delta, -1 to 1; 1 when every value of ``upper`` exceeds all of ``lower``."""
    u = stats.mannwhitneyu(upper, lower, method="asymptotic").statistic
    return float(2 * u / (len(lower) * len(upper)) - 1)


def median_interval(
    runs: Sequence[Array], seed: int, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """Return the bootstrap interval of the median over all values.

    Whole runs, (hops,) each, are resampled, because the hops of one run depend on each other; with
    a single run its hops are. Without values the 95 % percentile interval is NaN.
    """
    filled = [known for r in runs if len(known := r[np.isfinite(r)])]
    units = filled if len(filled) > 1 else [np.array([v]) for r in filled for v in r]
    if len(units) < 2:
        value = float(units[0][0]) if units else float("nan")
        return value, value

    def median_of(index: Array) -> float:
        return float(np.median(np.concatenate([units[int(i)] for i in index])))

    return bootstrap((np.arange(len(units)),), median_of, seed, resamples)


def bootstrap(
    samples: Sequence[Array | IntArray],
    statistic: Callable[..., Any],
    seed: int,
    resamples: int = RESAMPLES,
    *,
    vectorized: bool = False,
) -> tuple[float, float]:
    """Return the 95 % percentile interval of a statistic, every sample resampled on its own.

    Each sample is an argument of the statistic, which if vectorized has an argument ``axis``.
    """
    interval = stats.bootstrap(
        samples,
        statistic,
        vectorized=vectorized,
        n_resamples=resamples,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return float(interval.low), float(interval.high)
