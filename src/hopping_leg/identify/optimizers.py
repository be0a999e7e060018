"""A plan's search carried out: every candidate with every window in one batch, on disk as it goes.

Cost is the sum of squared residuals throughout, as the objective's robust loss weighs it.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify.cluster import Cluster
from hopping_leg.identify.cma import CmaOptions, cma_es
from hopping_leg.identify.least_squares import (
    Found,
    LeastSquaresOptions,
    Residuals,
    least_squares,
    multi_start,
)
from hopping_leg.identify.objective import Objective
from hopping_leg.identify.parameters import ParameterSet
from hopping_leg.identify.plan import Plan
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.robust_loss import RobustLoss, total_costs
from hopping_leg.identify.two_pass import pass_names, two_pass
from hopping_leg.identify.windows import deal

Progress = Callable[[float, float], None]
"""Called with the share done (0 to 1) and the lowest cost so far."""

Search = Callable[[Array, Path | None, Progress], Found]
"""From a start, the checkpoint and its progress report, to where the search ended."""

Report = Callable[[str, float, float], None]
"""Called with what is being done, its share done (0 to 1) and the lowest cost so far."""


@dataclass(frozen=True)
class SearchOptions:
    """How hard to search."""

    starts: int = 1
    """Searches, the first from the robot's own values and the others from random ones."""
    cma: CmaOptions = field(default_factory=CmaOptions)
    """Of CMA-ES, in each pass."""
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
    """One search: the paper's method has two, others one.

    Attributes:
        name: Of the pass.
        parameters: What it searched.
        found: Where it ended, from the best of its starts.
        others: Costs where the other starts ended, best first.
    """

    name: str
    parameters: ParameterSet
    found: Found
    others: tuple[float, ...] = ()


class Searcher:
    """Searches as a plan says.

    Args:
        plan: What to search, how.
        objective: Of the plan's parameters; a pass with others gets its own.
        options: How hard.
        seed: Of all randomness.
        folder: For checkpoints; None keeps none.
        report: Called with the progress.
        ray: Address of a Ray cluster that simulates, ``local`` for one on this machine; None
            simulates here.
        about: What else makes this run this run.
    """

    def __init__(
        self,
        plan: Plan,
        objective: Objective,
        options: SearchOptions,
        seed: int,
        folder: Path | None,
        report: Report,
        ray: str | None,
        about: Mapping[str, object],
    ) -> None:
        self._plan, self._objective, self._options = plan, objective, options
        self._seed, self._folder, self._report, self._ray = seed, folder, report, ray
        self._about = dict(about)

    def run(self, rigs: list[Rig]) -> list[Pass]:
        """Return the passes in order; the last one's end is the result.

        Args:
            rigs: Of the recordings.
        """
        if self._plan.search != "two-pass":
            return [self._pass(self._plan.search, self._plan.parameters, 0.0, 1.0)]
        passes: list[Pass] = []

        def search(name: str, parameters: ParameterSet) -> Found:
            passes.append(self._pass(f"two-pass, {name}", parameters, 0.5 * len(passes), 0.5))
            return passes[-1].found

        known = [name for names in pass_names(rigs) for name in names]
        own = self._plan.parameters.parameters
        two_pass(
            self._plan.start,
            rigs,
            search,
            further=[p.name for p in own if p.name not in known],
            start={p.name: p.start for p in own},
            bounds={p.name: (p.low, p.high) for p in own},
        )
        return passes

    def _pass(self, name: str, parameters: ParameterSet, begin: float, share: float) -> Pass:
        """Search from every start and report within a share of the whole."""
        objective = Objective(
            self._objective.recordings,
            self._objective.windows,
            parameters,
            self._objective.scoring,
            self._objective.timestep,
            self._objective.threads if self._ray is None else 1,
        )
        about = {**objective.about(), **self._about}
        starts = self._options.starts
        find = self._least_squares if self._plan.search == "least-squares" else self._cma
        searched = find(objective, about)

        def search(number: int, start: Array) -> Found:
            stage = name if starts == 1 else f"{name}, start {number + 1} of {starts}"
            file = f"search-{name.replace(', ', '-')}-{number}.json"

            def progress(done: float, cost: float) -> None:
                self._report(stage, begin + share * (number + done) / starts, cost)

            checkpoint = None if self._folder is None else self._folder / file
            return searched(start, checkpoint, progress)

        ends = multi_start(search, parameters, starts, self._seed)
        return Pass(name, parameters, ends[0], tuple(end.cost for end in ends[1:]))

    def _least_squares(self, objective: Objective, about: Mapping[str, object]) -> Search:
        residuals, loss = self._spread(objective.residuals), objective.loss
        options = self._options.least_squares

        def search(start: Array, checkpoint: Path | None, progress: Progress) -> Found:
            rounds = _Rounds(residuals, loss, options, progress)
            return least_squares(
                rounds,
                objective.parameters,
                options,
                loss=loss,
                groups=objective.jumping,
                start=start,
                about=about,
                checkpoint=checkpoint,
                report=rounds.finished,
            )

        return search

    def _cma(self, objective: Objective, about: Mapping[str, object]) -> Search:
        options = self._options.cma
        values = self._spread(objective)
        shares = [self._spread(share) for share in self._shares(objective)]

        def search(start: Array, checkpoint: Path | None, progress: Progress) -> Found:
            return cma_es(
                values,
                objective.parameters,
                options,
                seed=self._seed,
                start=start,
                shares=shares,
                about=about,
                checkpoint=checkpoint,
                report=lambda index, cost: progress(index / options.generations, cost),
            )

        return search

    def _shares(self, objective: Objective) -> list[Objective]:
        """Return what judges generations in turn; nothing if all windows can judge each."""
        rates = [r.metadata.rate_hz for r in objective.recordings]
        simulated = sum(w.length / rates[w.recording] for w in objective.windows)
        count = max(1, round(simulated / self._options.cma.seconds))
        hands = deal(objective.windows, count, np.random.default_rng(self._seed))
        if len(hands) < 2:
            return []
        return [dataclasses.replace(objective, windows=hand) for hand in hands]

    def _spread(self, evaluate: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Return a function of a population, on the cluster if there is one."""
        return evaluate if self._ray is None else Cluster(evaluate, self._ray)


class _Rounds:
    """Residuals that tell how far least squares has come, counting the steps that it tries."""

    def __init__(
        self,
        residuals: Residuals,
        loss: RobustLoss | None,
        options: LeastSquaresOptions,
        progress: Progress,
    ) -> None:
        self._residuals, self._loss = residuals, loss
        self._options, self._progress = options, progress
        self._round, self._tried, self._least = 0, 0, np.inf

    def __call__(self, vectors: Array) -> Array:
        """Return residuals of search vectors (n, k), (n, m)."""
        values = self._residuals(vectors)
        self._least = min(self._least, float(total_costs(values, self._loss).min()))
        self._tried += len(vectors) == 1
        self._tell()
        return values

    def finished(self, rounds: int, cost: float) -> None:
        """Note that a round is over."""
        self._round, self._tried, self._least = rounds, 0, cost
        self._tell()

    def _tell(self) -> None:
        within = min(self._tried / self._options.evaluations, 1.0)
        self._progress(min((self._round + within) / self._options.rounds, 1.0), self._least)
