"""A plan's search carried out: every candidate with every window in one batch.

Cost is the sum of squared residuals throughout, as the objective's robust loss weighs it. The
paper's search has two passes: "The parameters that can be roughly estimated during modeling, i.e.
link inertia and solver parameters, are fixed in a first optimization pass. In a second pass, we
optimize all dynamic and solver parameters while placing bounds on the friction, damping, and
armature parameters derived from the first pass."
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hopping_leg import errors, workers
from hopping_leg.arrays import Array
from hopping_leg.identify import optimizers, recording_format, windows
from hopping_leg.identify.cost import Objective
from hopping_leg.identify.optimizers import CmaOptions, Evaluate, Found, LeastSquaresOptions
from hopping_leg.identify.parameters import ParameterSet, choose
from hopping_leg.identify.plan import FitPlan, pass_names

_FACTOR = 2.0  # the paper's second pass keeps the first one's parameters within this factor

Report = Callable[[str, float, float], None]
"""Called with what is being done, its share done (0 to 1) and the lowest cost so far."""


@dataclass(frozen=True)
class SearchOptions:
    """How hard to search."""

    starts: int = 1
    """Searches, the first from the robot's own values and the others from random ones."""
    cma: CmaOptions = field(default_factory=CmaOptions)
    least_squares: LeastSquaresOptions = field(default_factory=LeastSquaresOptions)

    def __post_init__(self) -> None:
        if self.starts < 1 or self.cma.generations < 1 or self.cma.population < 4:
            raise errors.UsageError(
                "A search needs at least one start, one generation and four candidates in each."
            )
        if not self.cma.seconds > 0:
            raise errors.UsageError(
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

    def run(self, rigs: Sequence[recording_format.Rig]) -> list[Pass]:
        """Return the passes for recordings on rigs, in order; the last one's end is the result."""
        plan = self.plan
        if plan.search != "two-pass":
            return [self._pass(plan.search, plan.parameters, 0.0, 1.0)]
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

        ends = optimizers.multi_start(search, parameters, starts, self.seed)
        return Pass(name, parameters, ends[0], tuple(end.cost for end in ends[1:]))

    def _search_of(self, objective: Objective) -> Callable[..., Found]:
        """Return the plan's search, which still takes start and report."""
        if self.plan.search == "least-squares":
            return partial(
                optimizers.least_squares,
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
            optimizers.cma_es,
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
