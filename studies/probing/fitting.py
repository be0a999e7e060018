"""Linear probes by ridge regression, scored on other legs, with intervals over those legs.

A number is scored by R^2, classes by balanced accuracy: one map per class to 1 or 0, samples
weighted so that all classes count alike, and the largest answer wins.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, IntArray
from hopping_leg.evaluate.statistics import CONFIDENCE

RIDGES = (1e-6, 1e-4, 1e-2)
"""Shrinkage that is tried, per unit variance of the features."""

HELD_SHARE = 4
"""One in so many training legs chooses the shrinkage."""


@dataclass(frozen=True)
class Scored:
    """Sums over the ticks of each test leg, from which scores of any set of legs follow.

    Attributes:
        count: For numbers: ticks, sum, sum of squares and squared errors, (legs, 4); for classes:
            ticks and hits of each class, (legs, classes, 2).
    """

    count: Array

    def score(self, legs: IntArray | slice = slice(None)) -> float:
        """Return R^2 or balanced accuracy of some legs; NaN without ticks."""
        total = self.count[legs].sum(axis=0)
        if self.count.ndim == 3:
            found = total[total[:, 0] > 0]
            return float(np.mean(found[:, 1] / found[:, 0])) if len(found) else float("nan")
        ticks, first, second, error = total
        spread = second - first**2 / ticks if ticks else 0.0
        return float(1 - error / spread) if spread > 0 else float("nan")

    def rms(self) -> float | None:
        """Return the root mean square error of a number, None for classes."""
        if self.count.ndim == 3:
            return None
        ticks, _, _, error = self.count.sum(axis=0)
        return float(np.sqrt(error / ticks)) if ticks else float("nan")


def probe(train: Array, wanted: Array, test: Array, truth: Array, classes: int) -> Scored:
    """Fit a linear map and score it on other legs.

    Args:
        train: Features, (ticks, legs, size).
        wanted: Their target, (ticks, legs); NaN does not count.
        test: Features of other legs, (ticks, legs, size).
        truth: Their target, (ticks, legs).
        classes: Number of classes, 0 for a number.

    Returns:
        Scores that are NaN where there was nothing to learn from.
    """
    held = np.arange(train.shape[1]) % HELD_SHARE == 0
    if not all(np.isfinite(wanted[:, some]).any() for some in (held, ~held)):
        return Scored(np.zeros((truth.shape[1], *((classes, 2) if classes else (4,)))))
    best, chosen = -np.inf, RIDGES[-1]
    for ridge in RIDGES:
        weights = _fit(train[:, ~held], wanted[:, ~held], classes, ridge)
        score = _judge(weights, train[:, held], wanted[:, held], classes).score()
        if score > best:
            best, chosen = score, ridge
    return _judge(_fit(train, wanted, classes, chosen), test, truth, classes)


def interval(
    scored: Scored, seed: int, reference: Scored | None = None, resamples: int = 1000
) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of a score, legs resampled.

    Args:
        scored: On test legs.
        seed: Of the resampling.
        reference: Take the score less that of another probe on the same legs.
        resamples: How many.
    """
    rng, legs = np.random.default_rng(seed), len(scored.count)
    scores = []
    for _ in range(resamples):
        drawn = rng.integers(legs, size=legs)
        base = reference.score(drawn) if reference else 0.0
        scores.append(scored.score(drawn) - base)
    outside = (1 - CONFIDENCE) / 2
    known = [score for score in scores if np.isfinite(score)]
    low, high = np.quantile(known, [outside, 1 - outside]) if known else (np.nan, np.nan)
    return float(low), float(high)


def _fit(features: Array, wanted: Array, classes: int, ridge: float) -> tuple[Array, Array, Array]:
    """Return mean and scale of the features, (size,), and the map, (1 + size, outputs)."""
    known = np.isfinite(wanted)
    x, y = features[known].astype(np.float64), wanted[known]
    mean, scale = x.mean(axis=0), x.std(axis=0)
    scale = np.where(scale > 1e-9, scale, np.inf)
    x = np.concatenate([np.ones((len(x), 1)), (x - mean) / scale], axis=1)
    outputs, weight = y[:, None], np.full(len(y), 1 / len(y))
    if classes:
        outputs = (y[:, None] == np.arange(classes)).astype(np.float64)
        weight = (outputs / np.maximum(outputs.sum(axis=0), 1)).sum(axis=1) / classes
    weighted = x * weight[:, None]
    penalty = ridge * np.eye(x.shape[1])
    penalty[0, 0] = 0
    return mean, scale, np.linalg.solve(weighted.T @ x + penalty, weighted.T @ outputs)


def _judge(
    weights: tuple[Array, Array, Array], features: Array, truth: Array, classes: int
) -> Scored:
    mean, scale, matrix = weights
    answer = ((features - mean) / scale) @ matrix[1:] + matrix[0]
    known = np.isfinite(truth)
    if classes:
        hit = answer.argmax(axis=-1) == truth
        is_class = truth[..., None] == np.arange(classes)
        return Scored(np.stack([is_class.sum(0), (is_class & hit[..., None]).sum(0)], axis=-1))
    value, error = np.where(known, truth, 0.0), np.where(known, answer[..., 0] - truth, 0.0)
    sums = [known.sum(0), value.sum(0), (value**2).sum(0), (error**2).sum(0)]
    return Scored(np.stack(sums, axis=-1))
