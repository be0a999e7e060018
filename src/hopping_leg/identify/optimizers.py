"""Searches of a plan's parameters: bounded least squares, and CMA-ES in two passes as in the paper.

Cost is the sum of squared residuals throughout, as the objective's robust loss weighs it. "The
parameters that can be roughly estimated during modeling, i.e. link inertia and solver parameters,
are fixed in a first optimization pass. In a second pass, we optimize all dynamic and solver
parameters while placing bounds on the friction, damping, and armature parameters derived from the
first pass."
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cma
import numpy as np
from scipy import optimize

from hopping_leg import workers
from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.identify.cost import Objective, RobustLoss
from hopping_leg.identify.parameters import ParameterSet, choose
from hopping_leg.identify.plan import FitPlan, pass_names
from hopping_leg.identify.simulate import Window
from hopping_leg.robot import NO_MISMATCH

Evaluate = Callable[[Array], Array]
"""Search vectors (n, k) to costs (n,) or residuals (n, m), row by row independent."""
Progress = Callable[[float, float], None]
"""Called with the share done (0 to 1) and the lowest cost so far."""
Report = Callable[[str, float, float], None]
"""Called with what is being done, its share done (0 to 1) and the lowest cost so far."""

STEP = 1e-3
"""Finite difference of slopes, in units of the parameters' scales."""
_NOTHING = 1e-3  # a cost that is nothing, as residuals are in units of errors that matter
_MARGIN = 1.0  # scales that a start keeps from bounds, near which the trust region barely moves it
_SPREAD = 1.0  # first standard deviation of CMA-ES, in scales
_CONVERGED = 1e-9  # range of a generation's costs, relative to its best, that ends CMA-ES
_COLLAPSED = 1e-3  # standard deviation, in scales, below which a search by shares has ended
_RECENT = 4  # generations whose best stand for election at the end of CMA-ES
_NEAR = np.linspace(-0.9, 0.9, 19)  # logarithms of factors that are tried before each round
_FACTOR = 2.0  # the paper's second pass keeps the first one's parameters within this factor


@dataclass(frozen=True)
class SearchOptions:
    """How hard to search."""

    rounds: int = 4
    """Restarts of the trust region of least squares."""
    evaluations: int = 6
    """Steps tried in a round."""
    tolerance: float = 1e-4
    """A round that lowers the cost by a smaller share ends the search."""
    generations: int = 100
    """Of CMA-ES, in each pass."""
    population: int = 16
    """Candidates of a generation."""
    seconds: float = 25.0
    """Simulated for a candidate in each generation, about. Of more windows each generation is
    judged by another share, and the end by all."""

    def __post_init__(self) -> None:
        if self.generations < 1 or self.population < 4:
            raise UsageError("CMA-ES needs a generation and 4 candidates.")


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


@dataclass(frozen=True)
class Pass:
    """One search: the paper's method has two, others one."""

    name: str
    parameters: ParameterSet
    found: Found

    @property
    def values(self) -> dict[str, float]:
        """Where it ended, by name, SI, rounding left out that leads beyond bounds."""
        values = self.parameters.values(self.found.vector).tolist()
        ends = zip(self.parameters.parameters, values, strict=True)
        return {p.name: min(max(value, p.low), p.high) for p, value in ends}


def jacobian(
    residuals: Evaluate,
    vector: Array,
    bounds: tuple[Array, Array],
    groups: IntArray | None = None,
    step: float = STEP,
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
    loss: RobustLoss,
    options: SearchOptions = SearchOptions(),
    *,
    groups: IntArray | None = None,
    report: Progress = lambda share, cost: None,
) -> Found:
    """Search from the parameters' start.

    The loss weighs residuals that no parameters explain, at the levels of the moment, which makes
    the cost's own slope exact; ``groups`` are those of ``jacobian``.
    """
    low, high = parameters.bounds
    margin = np.minimum(_MARGIN, 0.25 * (high - low))
    vector = np.clip(0.0, low + margin, high - margin)
    history: list[float] = []
    count, tried, least, last = 0, 0, np.inf, np.empty(0)

    def counted(vectors: Array) -> Array:
        nonlocal count
        count += len(vectors)
        return residuals(vectors)

    def values(vector: Array) -> Array:
        nonlocal tried, least, last
        tried += 1
        last = counted(vector[None])[0]
        levelled = loss.levelled(last)
        least = min(least, float(np.sum(levelled**2)))
        report(min(tried / (options.rounds * options.evaluations), 1.0), least)
        return levelled

    def slopes(vector: Array) -> Array:
        """Return the slopes of ``values``, which was called with the same vector just before."""
        found = jacobian(counted, vector, (low, high), groups)
        still = np.zeros((len(loss.sizes), len(vector)))
        return np.concatenate([loss.weights(last)[:, None] * found, still])

    while len(history) < options.rounds:
        for k in np.flatnonzero(parameters.shares):  # the best of some that differ in this number
            near = vector[k] + _NEAR * parameters.start[k] / parameters.scale[k]
            vectors = np.tile(vector, (1 + len(_NEAR), 1))
            vectors[1:, k] = np.clip(near, low[k] + margin[k], high[k] - margin[k])
            costs = [np.sum(loss.levelled(r) ** 2) for r in counted(vectors)]
            vector = vectors[int(np.argmin(costs))]
        result = optimize.least_squares(
            values, vector, slopes, (low, high), x_scale="jac", max_nfev=options.evaluations
        )
        vector = result.x
        history.append(2 * float(result.cost))
        before, now = [np.inf, *history][-2:]
        if now < _NOTHING or now >= (1 - options.tolerance) * before:
            break
    return Found(vector, history[-1], count, history)


def cma_es(
    values: Evaluate,
    parameters: ParameterSet,
    options: SearchOptions = SearchOptions(),
    *,
    seed: int,
    shares: Sequence[Evaluate] = (),
    report: Progress = lambda share, cost: None,
) -> Found:
    """Search from the parameters' start by CMA-ES.

    Costs only rank the candidates of a generation, so a share of the data is enough to judge it
    by: each generation is judged by the next of ``shares``, whose sum is ``values``. As they take
    turns, the distribution's mean wanders about where all of them agree; its averages and the
    best are judged by everything, and the best one counts.
    """
    low, high = parameters.bounds
    first = np.clip(0.0, low, high)
    bounds = [low.tolist(), high.tolist()]
    settings = {"popsize": options.population, "bounds": bounds, "seed": np.nan, "verbose": -9}
    normal = np.random.default_rng(seed).standard_normal
    settings["randn"] = lambda *shape: normal(shape)
    strategy = cma.CMAEvolutionStrategy(first, _SPREAD, settings)
    judges = [*shares] or [values]
    bests, means, history = list[Array](), list[Array](), list[float]()
    least, winner = np.inf, first
    for generation in range(options.generations):
        vectors = np.array(strategy.ask())
        costs = judges[generation % len(judges)](vectors)
        strategy.tell(list(vectors), costs.tolist())
        means.append(np.array(strategy.result.xfavorite))
        bests.append(vectors[costs.argmin()])
        if len(judges) * float(costs.min()) < least:
            least, winner = len(judges) * float(costs.min()), bests[-1]
        history.append(least)
        report((generation + 1) / options.generations, least)
        converged = np.ptp(costs) <= _CONVERGED * abs(costs.min())
        if converged or (shares and np.max(strategy.result.stds) < _COLLAPSED):
            break
    spans = (1, len(judges), len(means) // 3 + 1)
    elected = np.array([winner, *bests[-_RECENT:], *(np.mean(means[-n:], axis=0) for n in spans)])
    final = values(elected)
    least, count = float(final.min()), len(history) * options.population + len(elected)
    return Found(elected[final.argmin()], least, count, [*history, least])


def search(
    plan: FitPlan,
    objective: Objective,
    options: SearchOptions,
    *,
    seed: int = 0,
    report: Report = lambda stage, share, cost: None,
    ray: str | None = None,
) -> list[Pass]:
    """Return the passes of a plan's search in order; the last one's end is the result.

    The objective costs the plan's parameters. ``ray`` is the address of a Ray cluster that
    simulates, ``local`` for one on this machine.
    """
    threads = objective.threads if ray is None else 1
    cluster = None if ray is None else workers.RayWorkers(ray)

    def spread(evaluate: Evaluate) -> Evaluate:
        return evaluate if cluster is None else partial(workers.map_rows, cluster, evaluate)

    def run(name: str, parameters: ParameterSet, begin: float = 0.0, share: float = 1.0) -> Pass:
        def progress(done: float, cost: float) -> None:
            report(name, begin + share * done, cost)

        goal = replace(objective, parameters=parameters, threads=threads)
        values, residuals = spread(goal), spread(goal.residuals)
        if plan.search == "least-squares":
            effort = (parameters, goal.loss, options)
            found = least_squares(residuals, *effort, groups=goal.jumping, report=progress)
        else:
            hands = deal(goal, options.seconds, np.random.default_rng(seed))
            shares = [spread(replace(goal, windows=hand)) for hand in hands]
            found = cma_es(values, parameters, options, seed=seed, shares=shares, report=progress)
        return Pass(name, parameters, found)

    every, paper = plan.parameters, plan.search == "two-pass"
    # Stiffnesses tell nothing while all other numbers are far off.
    added = [name for name in every.names if name.startswith("reality.") and plan.search != "cma"]
    if paper:
        added += pass_names([r.metadata.rig for r in objective.recordings])[1]
    kept = tuple(p for p in every.parameters if p.name not in added)
    if not added or not kept:
        return [run(plan.search, every)]
    rigid = replace(every.base, robot=replace(every.base.robot, reality=NO_MISMATCH))
    first = run(f"{plan.search}, first", ParameterSet(rigid, kept), 0.0, 0.5)
    second = second_pass(every, first, near=paper)
    return [first, run(f"{plan.search}, second", second, 0.5, 0.5)]


def second_pass(every: ParameterSet, first: Pass, *, near: bool = True) -> ParameterSet:
    """Return every parameter; those of the first pass start from its end, and may stay near it."""
    starts, bounds = first.values, {p.name: (p.low, p.high) for p in every.parameters}
    for p, value in zip(first.parameters.parameters, starts.values(), strict=True):
        if near and not p.name.startswith("drive."):
            reach = 0.1 * p.scale
            ends = (value / _FACTOR, value * _FACTOR, value - reach, value + reach)
            bounds[p.name] = (max(p.low, min(ends)), min(p.high, max(ends)))
    return choose(every.base, every.names, bounds=bounds, start=starts)


def deal(
    objective: Objective, seconds: float, rng: np.random.Generator
) -> list[tuple[Window, ...]]:
    """Deal windows to shares of about so many seconds; none where all of them are no more.

    Of so many windows in a row every share gets one, at random, lest a motion's period favour one.
    """
    windows, rates = objective.windows, [r.metadata.rate_hz for r in objective.recordings]
    simulated = sum(w.length / rates[w.recording] for w in windows)
    count = min(max(1, round(simulated / seconds)), len(windows))
    owners = np.concatenate([rng.permutation(count) for _ in range(-(-len(windows) // count))])
    pairs = list(zip(windows, owners, strict=False))
    shares = [tuple(w for w, owner in pairs if owner == share) for share in range(count)]
    return shares if count > 1 else []
