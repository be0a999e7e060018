"""CMA-ES, the paper's search, on any cost: a generation is one batch, and a killed run resumes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cma
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.checkpoint import load_state, save_state
from hopping_leg.identify.least_squares import Found
from hopping_leg.identify.parameters import ParameterSet

Values = Callable[[Array], Array]
"""Search vectors (n, k) to costs (n,)."""


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


_RECENT = 4
"""Generations whose best stand for election at the end of a search that is judged by shares."""

_COLLAPSED = 1e-3
"""Standard deviation, in units of the parameters' scales, below which such a search has ended."""


def cma_es(
    values: Values,
    parameters: ParameterSet,
    options: CmaOptions | None = None,
    *,
    seed: int,
    start: Array | None = None,
    shares: Sequence[Values] = (),
    about: Mapping[str, object] | None = None,
    checkpoint: Path | None = None,
    report: Callable[[int, float], None] = lambda index, cost: None,
) -> Found:
    """Search from one start.

    Costs only rank the candidates of a generation, so a share of the data is enough to judge it
    by. As shares take turns, the distribution's mean wanders about where all of them agree; its
    averages and the last generations' best are judged by everything, and the best one counts.

    The checkpoint holds every generation's costs. A resumed run draws the same generations from
    the same seed and takes their costs from there, so it ends bit for bit as if never killed.

    Args:
        values: Function of search vectors.
        parameters: Bounds and scales.
        options: How.
        seed: Of all randomness.
        start: Search vector to start from, (k,); None takes the parameters' start.
        shares: Functions whose sum is ``values``; each generation is judged by the next one in
            turn, and what comes out by ``values``, which judges everything if there are none.
        about: What else tells this search from others, e.g. the recordings' hashes.
        checkpoint: File for the state after each generation.
        report: Called with generation and best cost so far, or what its share makes of it.

    Raises:
        UsageError: The checkpoint belongs to another search.
    """
    options = options or CmaOptions()
    low, high = parameters.bounds
    first = np.clip(np.zeros(len(low)) if start is None else start, low, high)
    identity = {
        "parameters": repr(parameters.parameters),
        "start": first.tolist(),
        "options": repr(options),
        "seed": seed,
        "about": dict(about or {}),
    }
    saved = load_state(checkpoint, identity) or {"costs": []}
    costs: list[list[float]] = saved["costs"]
    bounds = [low.tolist(), high.tolist()]
    strategy = seeded_strategy(first, options.spread, bounds, options.population, seed)
    judges = [*shares] or [values]
    bests: list[Array] = []
    means: list[Array] = []
    history: list[float] = []
    for generation in range(options.generations):
        vectors = np.array(strategy.ask())
        if generation == len(costs):
            judge = judges[generation % len(judges)]
            costs.append(np.asarray(judge(vectors)).tolist())
            save_state(checkpoint, identity, {"costs": costs})
        found = np.array(costs[generation])
        strategy.tell(list(vectors), found.tolist())
        means.append(np.array(strategy.result.xfavorite))
        least = len(judges) * float(found.min())
        counts = bool(shares) or not history or least < history[-1]
        if counts:
            bests.append(vectors[found.argmin()])
        history.append(least if counts else history[-1])
        report(generation + 1, history[-1])
        if np.ptp(found) <= options.tolerance * abs(found.min()):
            break
        if shares and np.max(strategy.result.stds) < _COLLAPSED:
            break
    count = len(history) * options.population
    if not shares:
        return Found(bests[-1], history[-1], count, history)
    spans = (1, len(shares), len(means) // 3 + 1)
    elected = np.array([*bests[-_RECENT:], *(np.mean(means[-n:], axis=0) for n in spans)])
    final = np.asarray(values(elected))
    least = float(final.min())
    return Found(elected[final.argmin()], least, count + len(elected), [*history, least])


def seeded_strategy(
    first: Array, step: float, bounds: Sequence[object], population: int, seed: int
) -> cma.CMAEvolutionStrategy:
    """Return pycma's strategy; randomness comes from a generator of our own.

    Args:
        first: Where to begin, (size,).
        step: First step size.
        bounds: Lower and upper ones, a number or a list each.
        population: Candidates per generation.
        seed: Of the generator.
    """
    rng = np.random.default_rng(seed)
    settings = {
        "popsize": population,
        "bounds": bounds,
        "randn": lambda *shape: rng.standard_normal(shape),
        "seed": np.nan,
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(first, step, settings)
