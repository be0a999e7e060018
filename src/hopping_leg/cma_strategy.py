"""CMA-ES by pycma whose randomness comes from a generator of our own."""

from collections.abc import Sequence

import cma
import numpy as np

from hopping_leg.arrays import Array


def seeded_strategy(
    first: Array, step: float, bounds: Sequence[object], population: int, seed: int
) -> cma.CMAEvolutionStrategy:
    """Return pycma's strategy that begins at ``first``, (size,); bounds are numbers or lists."""
    rng = np.random.default_rng(seed)
    settings = {
        "popsize": population,
        "bounds": bounds,
        "randn": lambda *shape: rng.standard_normal(shape),
        "seed": np.nan,
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(first, step, settings)
