"""Searches of a plan's parameters: bounded least squares, and CMA-ES in two passes as in the paper.

Cost is the sum of squared residuals throughout, as the objective's robust loss weighs it. "The
parameters that can be roughly estimated during modeling, i.e. link inertia and solver parameters,
are fixed in a first optimization pass. In a second pass, we optimize all dynamic and solver
parameters while placing bounds on the friction, damping, and armature parameters derived from the
first pass."
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy import optimize

from hopping_leg import cma_strategy, workers
from hopping_leg.arrays import Array, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.identify import recording_format, windows
from hopping_leg.identify.cost import Objective, RobustLoss, total_costs
from hopping_leg.identify.parameters import ParameterSet, choose
from hopping_leg.identify.plan import FitPlan, pass_names

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


_REACH = 3.0  # scales from the first start that others are drawn within
_FACTOR = 2.0  # the paper's second pass keeps the first one's parameters within this factor

Report = Callable[[str, float, float], None]
"""Called with what is being done, its share done (0 to 1) and the lowest cost so far."""


@dataclass(frozen=True)
class SearchOptions:
    """How hard to search."""

    starts: int = 1
    """Searches, the first from the robot's own values and the others from random ones, up to three
    scales away; the best one counts."""
    cma: CmaOptions = field(default_factory=CmaOptions)
    least_squares: LeastSquaresOptions = field(default_factory=LeastSquaresOptions)

    def __post_init__(self) -> None:
        if self.starts < 1 or self.cma.generations < 1 or self.cma.population < 4:
            raise UsageError(
                "A search needs at least one start, one generation and four candidates in each."
            )
        if not self.cma.seconds > 0:
            raise UsageError(
                f"A generation is judged by {self.cma.seconds} s of windows but needs more than 0;"
                " infinity takes all."
            )


@dataclass(frozen=True)
class Pass:
    """One search: the paper's method has two, others one."""

    name: str
    parameters: ParameterSet
    found: Found
    others: tuple[float, ...] = ()
    """Costs where the other starts ended, best first."""


@dataclass(frozen=True)
class Searcher:
    """Searches as a plan says."""

    plan: FitPlan
    objective: Objective
    """Cost of the plan's parameters; a pass with others gets its own."""
    options: SearchOptions
    seed: int = 0
    report: Report = lambda stage, share, cost: None
    ray: str | None = None
    """Address of a Ray cluster that simulates, ``local`` for one on this machine; None simulates
    here."""

    def run(self) -> list[Pass]:
        """Return the passes in order; the last one's end is the result."""
        plan = self.plan
        if plan.search != "two-pass":
            return [self._pass(plan.search, plan.parameters, 0.0, 1.0)]
        rigs = [r.metadata.rig for r in self.objective.recordings]
        names, added = pass_names(rigs)
        own = {p.name: p for p in plan.parameters.parameters}
        start = {name: p.start for name, p in own.items()}
        bounds = {name: (p.low, p.high) for name, p in own.items()}
        further = [name for name in own if name not in (*names, *added)]
        parameters = choose(plan.start, [*names, *further], bounds=bounds, start=start)
        first = self._pass("two-pass, first", parameters, 0.0, 0.5)
        parameters = second_pass(parameters, first.found, rigs, bounds, start)
        return [first, self._pass("two-pass, second", parameters, 0.5, 0.5)]

    def _pass(self, name: str, parameters: ParameterSet, begin: float, share: float) -> Pass:
        """Search from every start and report within a share of the whole."""
        threads = self.objective.threads if self.ray is None else 1
        objective = replace(self.objective, parameters=parameters, threads=threads)
        searched = self._search_of(objective)
        starts = self.options.starts

        def search(number: int, start: Array) -> Found:
            stage = name if starts == 1 else f"{name}, start {number + 1} of {starts}"

            def progress(done: float, cost: float) -> None:
                self.report(stage, begin + share * (number + done) / starts, cost)

            return searched(start=start, report=progress)

        low, high = parameters.bounds
        begins = np.random.default_rng(self.seed).uniform(
            np.maximum(low, -_REACH), np.minimum(high, _REACH), (starts, len(low))
        )
        begins[0] = np.clip(0.0, low, high)
        ends = sorted((search(*pair) for pair in enumerate(begins)), key=lambda end: end.cost)
        return Pass(name, parameters, ends[0], tuple(end.cost for end in ends[1:]))

    def _search_of(self, objective: Objective) -> Callable[..., Found]:
        """Return the plan's search, which still takes start and report."""
        if self.plan.search == "least-squares":
            return partial(
                least_squares,
                self._spread(objective.residuals),
                objective.parameters,
                self.options.least_squares,
                loss=objective.loss,
                groups=objective.jumping,
            )
        rates = [r.metadata.rate_hz for r in objective.recordings]
        simulated = sum(w.length / rates[w.recording] for w in objective.windows)
        count = max(1, round(simulated / self.options.cma.seconds))
        hands = windows.deal(objective.windows, count, np.random.default_rng(self.seed))
        hands = hands if len(hands) > 1 else []  # all windows can judge each generation
        return partial(
            cma_es,
            self._spread(objective),
            objective.parameters,
            self.options.cma,
            seed=self.seed,
            shares=[self._spread(replace(objective, windows=hand)) for hand in hands],
        )

    def _spread(self, evaluate: Evaluate) -> Evaluate:
        return (
            evaluate
            if self.ray is None
            else partial(workers.map_rows, workers.RayWorkers(self.ray), evaluate)
        )


def second_pass(
    first: ParameterSet,
    found: Found,
    rigs: Sequence[recording_format.Rig],
    bounds: Mapping[str, tuple[float, float]],
    start: Mapping[str, float],
) -> ParameterSet:
    """Return the second pass's parameters; bounds and starts are those of the added ones."""
    names, added = pass_names(rigs)
    starts, every = {**start}, {**bounds}
    for p, value in zip(first.parameters, first.values(found.vector).tolist(), strict=True):
        low, high = p.low, p.high
        if p.name in names:
            reach = 0.1 * p.scale
            low = max(low, min(value / _FACTOR, value * _FACTOR, value - reach))
            high = min(high, max(value / _FACTOR, value * _FACTOR, value + reach))
        starts[p.name], every[p.name] = value, (low, high)
    return choose(first.base, [*first.names, *added], bounds=every, start=starts)
