"""What the search for energy shaping's gains minimises."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import Rollout
from hopping_leg.controllers.shaping_gains import ShapingGains
from hopping_leg.hop_detection import measure_hops

SETTLED = 2.0
"""Hops before this do not count, s."""

_RATE = 1.5
"""Fewer hops per second than this cost."""

_FLIGHT = 0.1
"""Cost of a lack of flight, m: a tenth of the time, 1 cm."""

_KNEE, _BASE = 0.012, 0.06
"""Less room than this between knee or base and the ground costs, m."""


@dataclass(frozen=True)
class CommandScore:
    """How a candidate hops at one command.

    Attributes:
        command: Desired apex, m.
        median: Of all apexes, m; NaN without hops.
        std: Of all apexes, m.
        rate: Hops per second.
        flight: Share of the time with the foot off the ground.
        knee_clearance: Least gap between knee and ground, m.
        base_clearance: Least gap between base and ground, m.
    """

    command: float
    median: float
    std: float
    rate: float
    flight: float
    knee_clearance: float
    base_clearance: float


def score(rollout: Rollout, command: float, legs: slice) -> CommandScore:
    """Score the legs of a rollout that have one command."""
    data, kept = rollout.data, rollout.time >= SETTLED
    period = rollout.time[1] - rollout.time[0]
    names = ("height_m", "height_rate_m_s", "foot_clearance_m")
    columns = (data[name][kept, legs].T for name in names)
    hops = [measure_hops(h, v, c, 1 / period) for h, v, c in zip(*columns, strict=True)]
    apex = np.concatenate([h.apex for h in hops])
    settled = len(hops) * kept.sum() * period
    return CommandScore(
        command,
        float(np.median(apex)) if len(apex) else float("nan"),
        float(np.std(apex)) if len(apex) else float("nan"),
        len(apex) / settled,
        sum(h.flight_ticks for h in hops) / sum(h.ticks for h in hops),
        float(data["knee_clearance_m"][kept, legs].min()),
        float(data["base_clearance_m"][kept, legs].min()),
    )


def cost(scores: list[CommandScore], flight: float = 0.0) -> float:
    """Return scatter, what bias no calibration removes, missed hops and lack of room, mm.

    Args:
        scores: One per command.
        flight: Share of the time in the air that is asked for at every command; less costs.
    """
    if any(np.isnan(s.median) for s in scores):
        return 500.0
    _, _, residual = _line(scores)
    terms = [
        s.std
        + abs(r)
        + 0.03 * max(0.0, _RATE - s.rate)
        + _FLIGHT * max(0.0, flight - s.flight)
        + max(0.0, _KNEE - s.knee_clearance)
        + max(0.0, _BASE - s.base_clearance)
        for s, r in zip(scores, residual, strict=True)
    ]
    return 1e3 * float(np.mean(terms))


def calibrated(gains: ShapingGains, scores: list[CommandScore]) -> ShapingGains:
    """Return the gains with the affine height estimate that would have met the commands."""
    shift, scale, _ = _line([s for s in scores if not np.isnan(s.median)])
    return dataclasses.replace(
        gains,
        height_offset=shift + scale * gains.height_offset,
        height_scale=scale * gains.height_scale,
    )


def _line(scores: list[CommandScore]) -> tuple[float, float, Array]:
    """Fit median - 0.3 = shift + scale (command - 0.3), m; return both and the residuals, m."""
    lean = np.array([s.command for s in scores]) - 0.3
    reached = np.array([s.median for s in scores]) - 0.3
    scale, shift = np.polyfit(lean, reached, 1)
    return float(shift), float(scale), reached - shift - scale * lean
