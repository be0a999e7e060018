"""The searches: bounded least squares, and CMA-ES as in the paper."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize

from hopping_leg import cma_strategy
from hopping_leg.arrays import Array, IntArray
from hopping_leg.identify.cost import RobustLoss, total_costs
from hopping_leg.identify.parameters import ParameterSet

Evaluate = Callable[[Array], Array]
"""Search vectors (n, k) to costs (n,) or residuals (n, m), row by row independent."""
Progress = Callable[[float, float], None]
"""Called with the share done (0 to 1) and the lowest cost so far."""
_NOTHING = 1e-3  # a cost that is nothing, as residuals are in units of errors that matter
_MARGIN = 1.0  # scales that a start keeps from bounds, near which the trust region barely moves it


@dataclass(frozen=True)
class LeastSquaresOptions:
    """How to search."""

    rounds: int = 4
    """Restarts of the trust region."""
    evaluations: int = 6
    """Steps tried in a round."""
    step: float = 1e-3
    """Finite difference, in units of the parameters' scales."""
    tolerance: float = 1e-4
    """A round that lowers the cost by a smaller share ends the search."""


@dataclass(frozen=True)
class Found:
    """Where a search ended."""

    vector: Array
    """In search coordinates, (k,)."""
    cost: float
    """Sum of squared residuals, as the levels of unexplained ones weigh it."""
    evaluations: int
    """Candidates simulated."""
    history: list[float]
    """Best cost after each round or generation."""


def jacobian(
    residuals: Evaluate,
    vector: Array,
    bounds: tuple[Array, Array],
    step: float,
    groups: IntArray | None = None,
) -> Array:
    """Return d residuals / d vector, (m, k), by differences of a step in search coordinates.

    A simulated touchdown falls on one physics step or the next, so that residuals of a window on
    the ground jump a little wherever a parameter moves it across. A difference that spans such a
    jump is hundreds of times the slope, and one bad column misleads the whole search. So with
    ``groups``, the number of each residual's window, (m,), every slope is taken on both sides, or
    inside one bound at two distances, and each group goes by the calmer one.
    """
    low, high = bounds
    room = np.minimum(step, np.maximum(high - vector, vector - low))
    near = np.where(vector + room <= high, room, -room)
    steps = [near]
    if groups is not None:
        other = vector - near
        steps.append(np.where((low <= other) & (other <= high), -near, 0.5 * near))
    moved = [vector + np.diag(one) for one in steps]
    values = residuals(np.concatenate([vector[None], *moved]))
    sides = np.reshape(values[1:] - values[0], (len(steps), len(vector), -1))
    slopes = sides / np.stack(steps)[..., None]
    if groups is None:
        return np.asarray(slopes[0].T)
    squares = np.apply_along_axis(lambda s: np.bincount(groups, np.square(s)), -1, slopes)
    calm = (squares[0] <= squares[1])[:, groups]
    return np.ascontiguousarray(np.where(calm, *slopes).T)


def least_squares(
    residuals: Evaluate,
    parameters: ParameterSet,
    options: LeastSquaresOptions | None = None,
    *,
    loss: RobustLoss | None = None,
    groups: IntArray | None = None,
    start: Array | None = None,
    report: Progress = lambda share, cost: None,
) -> Found:
    """Search from one start, (k,), or the parameters' own.

    The loss weighs residuals that no parameters explain; ``groups`` are those of ``jacobian``.
    """
    options = options or LeastSquaresOptions()
    low, high = parameters.bounds
    margin = np.minimum(_MARGIN, 0.25 * (high - low))
    vector = np.clip(np.zeros(len(low)) if start is None else start, low + margin, high - margin)
    history: list[float] = []
    evaluations = 0
    while len(history) < options.rounds and not _settled(history, options.tolerance):
        least = history[-1] if history else np.inf
        rounds = len(history)
        problem = _Problem(residuals, (low, high), options, loss, groups, report, rounds, least)
        result = optimize.least_squares(
            problem.values,
            vector,
            jac=problem.slopes,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=options.evaluations,
        )
        vector, cost = result.x, 2 * float(result.cost)
        evaluations += problem.count
        history.append(cost)
        report(len(history) / options.rounds, cost)
    return Found(vector, history[-1], evaluations, history)


def multi_start(
    search: Callable[[int, Array], Found], parameters: ParameterSet, starts: int, seed: int
) -> list[Found]:
    """Search from the parameters' start and from random others; best first.

    The others are drawn within the bounds, up to three scales from the start; ``search`` goes from
    a start's number and vector to where it ended.
    """
    low, high = parameters.bounds
    rng = np.random.default_rng(seed)
    draws = rng.uniform(np.maximum(low, -3), np.minimum(high, 3), (starts, len(low)))
    draws[0] = np.clip(0.0, low, high)
    return sorted((search(i, x) for i, x in enumerate(draws)), key=lambda found: found.cost)


def _settled(history: list[float], tolerance: float) -> bool:
    settled = len(history) > 1 and history[-2] - history[-1] <= tolerance * history[-2]
    return settled or bool(history and history[-1] < _NOTHING)


@dataclass
class _Problem:
    """Residuals whose squares add up to the cost, and their slopes; reports every step tried.

    The slopes are those at the levels of the moment, which make the cost's own slope exact.
    """

    residuals: Evaluate
    bounds: tuple[Array, Array]
    options: LeastSquaresOptions
    loss: RobustLoss | None
    groups: IntArray | None
    report: Progress
    rounds: int
    least: float
    at: Array = field(default_factory=lambda: np.empty(0))
    count: int = 0
    tried: int = 0

    def values(self, vector: Array) -> Array:
        """Return residuals, (m,), and with a robust loss what each group costs beside them."""
        residuals: Array = self._counted(vector[None])[0]
        if self.loss is None:
            return residuals
        weights, rest = self.loss.weights(residuals), self.loss.rest(residuals)
        return np.concatenate([weights * residuals, rest])

    def slopes(self, vector: Array) -> Array:
        """Return the slopes of what ``values`` returns, (m, k)."""
        slopes = jacobian(self._counted, vector, self.bounds, self.options.step, self.groups)
        if self.loss is None:
            return slopes
        still = np.zeros((len(self.loss.sizes), len(vector)))
        return np.concatenate([self.loss.weights(self.at)[:, None] * slopes, still])

    def _counted(self, vectors: Array) -> Array:
        self.count += len(vectors)
        self.tried += len(vectors) == 1
        values = self.residuals(vectors)
        self.at = values[0]
        self.least = min(self.least, float(total_costs(values, self.loss).min()))
        within = min(self.tried / self.options.evaluations, 1.0)
        self.report(min((self.rounds + within) / self.options.rounds, 1.0), self.least)
        return values


@dataclass(frozen=True)
class CmaOptions:
    """How to search."""

    generations: int = 100
    population: int = 16
    """Candidates of a generation."""
    spread: float = 1.0
    """First standard deviation, in units of the parameters' scales."""
    tolerance: float = 1e-9
    """Range of a generation's costs, relative to its best, below which the search has converged."""
    seconds: float = 25.0
    """Simulated for a candidate in each generation, about. Of more windows each generation is
    judged by another share, and the end by all."""


_RECENT = 4  # generations whose best stand for election at the end of a search by shares
_COLLAPSED = 1e-3  # standard deviation, in scales, below which such a search has ended


def cma_es(
    values: Evaluate,
    parameters: ParameterSet,
    options: CmaOptions | None = None,
    *,
    seed: int,
    start: Array | None = None,
    shares: Sequence[Evaluate] = (),
    report: Progress = lambda share, cost: None,
) -> Found:
    """Search from one start by CMA-ES.

    Costs only rank the candidates of a generation, so a share of the data is enough to judge it
    by. As shares take turns, the distribution's mean wanders about where all of them agree; its
    averages and the last generations' best are judged by everything, and the best one counts.

    Each generation is judged by the next of ``shares``, whose sum is ``values``, or by ``values``
    itself. Progress reports what the generation's share makes of the best cost.
    """
    options = options or CmaOptions()
    low, high = parameters.bounds
    first = np.clip(np.zeros(len(low)) if start is None else start, low, high)
    bounds = [low.tolist(), high.tolist()]
    strategy = cma_strategy.seeded_strategy(first, options.spread, bounds, options.population, seed)
    judges = [*shares] or [values]
    bests: list[Array] = []
    means: list[Array] = []
    history: list[float] = []
    for generation in range(options.generations):
        vectors = np.array(strategy.ask())
        found = judges[generation % len(judges)](vectors)
        strategy.tell(list(vectors), found.tolist())
        means.append(np.array(strategy.result.xfavorite))
        least = len(judges) * float(found.min())
        counts = bool(shares) or not history or least < history[-1]
        if counts:
            bests.append(vectors[found.argmin()])
        history.append(least if counts else history[-1])
        report((generation + 1) / options.generations, history[-1])
        converged = np.ptp(found) <= options.tolerance * abs(found.min())
        if converged or (shares and np.max(strategy.result.stds) < _COLLAPSED):
            break
    count = len(history) * options.population
    if not shares:
        return Found(bests[-1], history[-1], count, history)
    spans = (1, len(shares), len(means) // 3 + 1)
    elected = np.array([*bests[-_RECENT:], *(np.mean(means[-n:], axis=0) for n in spans)])
    final = values(elected)
    least = float(final.min())
    return Found(elected[final.argmin()], least, count + len(elected), [*history, least])
