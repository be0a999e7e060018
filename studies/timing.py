"""Timing that other load on the computer cannot bias: alternate what is compared, take medians."""

import os
import platform
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.io import versions

Timed = Callable[[], None]


def seconds(function: Timed) -> float:
    """Return how long one call takes, s."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def interleave(
    functions: Mapping[str, Timed],
    repeats: int,
    on_repeat: Callable[[int, int], None] | None = None,
) -> dict[str, Array]:
    """Time functions in turn, again and again.

    Args:
        functions: What to time, by name.
        repeats: Rounds.
        on_repeat: Called with (rounds done, rounds in all), for progress bars.

    Returns:
        Seconds by name, (repeats,); the first, cold round is not in it.
    """
    for function in functions.values():
        function()
    taken: dict[str, list[float]] = {name: [] for name in functions}
    for done in range(repeats):
        for name, function in functions.items():
            taken[name].append(seconds(function))
        if on_repeat is not None:
            on_repeat(done + 1, repeats)
    return {name: np.array(values) for name, values in taken.items()}


def median_ratio(numerator: Array, denominator: Array) -> float:
    """Return the median over rounds of the ratio of two durations."""
    return float(np.median(numerator / denominator))


def host() -> dict[str, Any]:
    """Return what a timing depends on: processor, load, versions."""
    return {
        "cores": os.cpu_count(),
        "machine": platform.machine(),
        "load_average": os.getloadavg()[0],
        **versions("mujoco", "numpy", "gymnasium"),
    }
