"""CMA-ES, the paper's search, on any cost: a generation is one batch, and a killed run resumes."""

from collections.abc import Callable, Mapping
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
    """Range of costs, relative to the best, below which the search has converged."""


def cma_es(
    values: Values,
    parameters: ParameterSet,
    options: CmaOptions | None = None,
    *,
    seed: int,
    start: Array | None = None,
    about: Mapping[str, object] | None = None,
    checkpoint: Path | None = None,
    report: Callable[[int, float], None] = lambda index, cost: None,
) -> Found:
    """Search from one start.

    The checkpoint holds every generation's costs. A resumed run draws the same generations from
    the same seed and takes their costs from there, so it ends bit for bit as if never killed.

    Args:
        values: Function of search vectors.
        parameters: Bounds and scales.
        options: How.
        seed: Of all randomness.
        start: Search vector to start from, (k,); None takes the parameters' start.
        about: What else tells this search from others, e.g. the recordings' hashes.
        checkpoint: File for the state after each generation.
        report: Called with generation and best cost so far.

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
    strategy = cma.CMAEvolutionStrategy(first, options.spread, _settings(options, low, high, seed))
    best, least, history = first, np.inf, []
    for generation in range(options.generations):
        vectors = np.array(strategy.ask())
        if generation == len(costs):
            costs.append(np.asarray(values(vectors)).tolist())
            save_state(checkpoint, identity, {"costs": costs})
        found = np.array(costs[generation])
        strategy.tell(list(vectors), found.tolist())
        if found.min() < least:
            best, least = vectors[found.argmin()], float(found.min())
        history.append(least)
        report(generation + 1, least)
        if np.ptp(found) <= options.tolerance * abs(least):
            break
    return Found(best, least, len(history) * options.population, history)


def _settings(options: CmaOptions, low: Array, high: Array, seed: int) -> dict[str, object]:
    """Return pycma's options; randomness comes from a generator of our own."""
    rng = np.random.default_rng(seed)
    return {
        "popsize": options.population,
        "bounds": [low.tolist(), high.tolist()],
        "randn": lambda *shape: rng.standard_normal(shape),
        "seed": np.nan,
        "verbose": -9,
    }
