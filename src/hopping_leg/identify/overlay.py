"""Measured beside simulated, row by row, before and after a fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.cost import measured
from hopping_leg.identify.judging import unscored
from hopping_leg.identify.leg_hypothesis import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import Window, cut

RESTART = 0.5
"""Where a recording's torques are commanded there is no loop that holds the simulation to it; it
is started anew so often, s."""


@dataclass(frozen=True)
class Overlay:
    """One recording; NaN where nothing was measured or simulated.

    Attributes:
        recording: The recording or part of one.
        restarted: Whether the simulation was started anew every ``RESTART``.
        position: Measured, and counted, rad, (rows, 2).
        torque: Likewise, N m, (rows, 2).
        simulated_position: By each hypothesis, rad, (hypotheses, rows, 2).
        simulated_torque: Likewise, N m, (hypotheses, rows, 2).
    """

    recording: Recording
    restarted: bool
    position: Array
    torque: Array
    simulated_position: Array
    simulated_torque: Array

    def errors(self, quantity: str) -> Array:
        """Return simulated minus measured, (hypotheses, rows, 2).

        Args:
            quantity: ``position`` or ``torque``.
        """
        difference: Array = getattr(self, f"simulated_{quantity}") - getattr(self, quantity)
        return difference


def overlays(
    recordings: Sequence[Recording],
    hypotheses: Sequence[LegHypothesis],
    timestep: float,
    threads: int = 0,
) -> list[Overlay]:
    """Simulate recordings with hypotheses.

    Args:
        recordings: Best those that no fit has seen.
        hypotheses: To compare.
        timestep: Physics step, s.
        threads: Worker threads, 0 for one per core.
    """
    skip = unscored(recordings)
    return [_overlay(r, hypotheses, timestep, threads, skip) for r in recordings]


def _overlay(
    recording: Recording,
    hypotheses: Sequence[LegHypothesis],
    timestep: float,
    threads: int,
    skip: float,
) -> Overlay:
    restarted = recording.metadata.onboard == "torque"
    windows: list[Window] = (
        cut([recording], RESTART) if restarted else cut([recording], None, unscored=skip)
    )
    simulator = WindowSimulator([recording], windows, timestep=timestep, threads=threads)
    simulated = simulator.run(hypotheses)
    rows = len(recording)
    filled = {}
    for name in ("position", "torque"):
        filled[name] = _in_rows(measured(simulator, name)[None], windows, rows)[0]
        filled[f"simulated_{name}"] = _in_rows(getattr(simulated, name), windows, rows)
    return Overlay(recording, restarted, **filled)


def _in_rows(values: Array, windows: Sequence[Window], rows: int) -> Array:
    """Put windows (n, windows, length, 2) where they lie in their recording, (n, rows, 2)."""
    placed = np.full((len(values), rows, 2), np.nan)
    for index, window in enumerate(windows):
        stop = window.start + window.length
        placed[:, window.start : stop] = values[:, index, : window.length]
    return placed
