"""The paper's excitation trajectories: the foot strokes along the leg, the leg may swing."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import UsageError
from hopping_leg.identify import excitation, recording_format
from hopping_leg.robot import Robot, kinematics

DURATION = 240.0  # Duration of the paper's recordings, s
AMPLITUDES, PERIODS, SWINGS = (0.15, 0.1, 0.05), (0.75, 0.5, 0.25), (10.0, 20.0)
"""A in m, T1 and T2 in s of the paper's recordings."""
LAB_MARGIN = 0.005
"""How far from straight the lab kept the leg in its recordings, m; the paper says nothing."""
_SHRINK = 0.95
_SMALLEST = 0.005

Bend = Literal["backward", "forward"]


@dataclass(frozen=True)
class Stroke:
    """A stretch of the paper's template: amplitude A, m, period T1, swing T2 and duration, s.

    The foot's distance from the hip is r = A cos(2 pi t / T1) + epsilon with
    epsilon = L1 + L2 - A - margin; its direction is theta = -(pi/2) cos(2 pi t / T2), or straight
    down without T2. Only whole periods are played, then the foot waits, so that strokes join.
    """

    amplitude: float
    period: float
    swing: float | None
    duration: float
    margin: float = 0.0
    bend: Bend = "backward"
    """Side of the knee: negative angles are backward."""
    rig: recording_format.Rig = "fixed-base"

    def __post_init__(self) -> None:
        excitation.require_positive(amplitude=self.amplitude, period=self.period)
        excitation.require_positive(duration=self.duration, swing=self.swing)
        if not 0 <= self.margin < math.inf:
            raise UsageError(f"'margin' is {self.margin:g} m but must be zero or more.")

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times from the stroke's start, rad, (ticks, 2)."""
        reach = robot.thigh.length + robot.shank.length
        epsilon = reach - self.amplitude - self.margin
        distance = self.amplitude * np.cos(self._phase(time, self.period)) + epsilon
        theta = np.zeros_like(time)
        if self.swing is not None:
            theta = -np.pi / 2 * np.cos(self._phase(time, self.swing))
        side = 1.0 if self.bend == "backward" else -1.0
        forward = side * distance * np.sin(theta)
        foot = np.stack([distance * np.cos(theta), forward], axis=-1)
        angles = np.where((distance > 0)[:, None], kinematics.joint_angles(robot, foot), np.nan)
        return side * np.unwrap(angles, axis=0)

    def __str__(self) -> str:
        swing = "" if self.swing is None else f", T2 {self.swing:g} s"
        return f"{self.duration:g} s with A {self.amplitude:.4g} m, T1 {self.period:g} s{swing}"

    def _phase(self, time: Array, period: float) -> Array:
        periods = math.floor(self.duration / period + 1e-9)
        whole = periods * period if periods else self.duration
        return np.asarray(2 * np.pi * np.minimum(time, whole) / period)


@dataclass(frozen=True)
class Strokes:
    """Strokes one after the other."""

    parts: tuple[Stroke, ...]

    def __str__(self) -> str:
        return "; ".join(map(str, self.parts))

    @property
    def rig(self) -> recording_format.Rig:
        """What the base is on."""
        return self.parts[0].rig

    @property
    def duration(self) -> float:
        """In all, s."""
        return sum(part.duration for part in self.parts)

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2)."""
        starts = np.cumsum([0.0, *(part.duration for part in self.parts[:-1])])
        which = np.searchsorted(starts, time + 1e-9, side="right") - 1
        pairs = enumerate(zip(self.parts, starts, strict=True))
        angles = [part.joints(robot, time[which == i] - start) for i, (part, start) in pairs]
        return np.unwrap(np.concatenate(angles), axis=0)


def fixed_base(
    amplitudes: Sequence[float] = AMPLITUDES,
    periods: Sequence[float] = PERIODS,
    swings: Sequence[float | None] = SWINGS,
    *,
    duration: float = DURATION,
    margin: float = 0.0,
    bend: Bend = "backward",
    rig: recording_format.Rig = "fixed-base",
) -> Strokes:
    """Return the paper's fixed-base trajectory: the foot strokes while the leg swings.

    The first amplitude goes with the first period and so on, as in the lab's recordings, each pair
    with every swing; the duration of all, s, is divided evenly. See ``Stroke``.
    """
    if len(amplitudes) != len(periods) or not amplitudes or not swings:
        raise UsageError(
            f"{len(amplitudes)} amplitudes and {len(periods)} periods do not pair; give as many of"
            " one as of the other."
        )
    grid = list(itertools.product(zip(amplitudes, periods, strict=True), swings))
    length = duration / len(grid)
    parts = tuple(Stroke(a, t1, t2, length, margin, bend, rig) for (a, t1), t2 in grid)
    slowest = max(max(part.period, part.swing or 0.0) for part in parts)
    if len(grid) > 1 and length < slowest - 1e-9:
        raise UsageError(
            f"Each of {len(grid)} strokes lasts {length:.3g} s, less than a period of"
            f" {slowest:g} s; make them {len(grid) * slowest:g} s or longer in all."
        )
    return Strokes(parts)


moving_base = partial(fixed_base, swings=(None,), rig="rail")
"""The paper's moving-base trajectory: vertical strokes on the ground, some leave it."""


def adapt(strokes: Strokes, robot: Robot, *, rate: float = excitation.RATE) -> Strokes:
    """Return the strokes as large as the leg can follow: the paper's grid does not fit every leg.

    Amplitudes shrink in steps of 5 %, and the leg stays ``LAB_MARGIN`` from straight, where the
    knee would have to jump; the rate is in Hz. UsageError says that a stroke is beyond the leg at
    any amplitude.
    """
    parts = []
    for stroke in strokes.parts:
        part = replace(stroke, margin=max(stroke.margin, LAB_MARGIN))
        while True:
            try:
                excitation.possible_demand(part, robot, rate)
                break
            except UsageError:
                if part.amplitude * _SHRINK < _SMALLEST:
                    raise
                part = replace(part, amplitude=part.amplitude * _SHRINK)
        parts.append(part)
    return Strokes(tuple(parts))
