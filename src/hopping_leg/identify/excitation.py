"""Excitations: what the joints are told to do, in a file that all who play it share."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import TraceError, UsageError
from hopping_leg.identify.columns import PAIRS
from hopping_leg.identify.feasibility import HardwareRange, check_demand, demand
from hopping_leg.identify.paper_excitation import LAB_MARGIN, Stroke, Strokes
from hopping_leg.identify.recording_format import Rig
from hopping_leg.identify.templates import Template
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace

RATE = 200.0
"""Of the paper's recordings, Hz."""

_KEY = "excitation"
_SHRINK = 0.95
_SMALLEST = 0.005


@dataclass(frozen=True)
class Excitation:
    """Targets of the joints' PD over time.

    Attributes:
        time: From 0 on, s, (ticks,).
        position: rad, (ticks, 2).
        velocity: rad/s, (ticks, 2); zero where only positions are tracked, as the paper says.
        rig: What the base is on.
        rate: Hz.
        robot: Name of the robot that it was checked for.
        description: How it was made.
    """

    time: Array
    position: Array
    velocity: Array
    rig: Rig
    rate: float
    robot: str
    description: str

    def __len__(self) -> int:
        return len(self.time)

    @property
    def digest(self) -> str:
        """SHA-256 over time, positions and velocities, hex."""
        values = np.column_stack([self.time, self.position, self.velocity])
        return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()

    def save(self, path: Path) -> None:
        """Write a Parquet file.

        Raises:
            TraceError: The file cannot be written.
        """
        names = (*PAIRS["position_command"], *PAIRS["velocity_command"])
        targets = (*self.position.T, *self.velocity.T)
        columns = {"time_s": self.time} | dict(zip(names, targets, strict=True))
        facts = {
            "rig": self.rig,
            "rate_hz": self.rate,
            "robot": self.robot,
            "description": self.description,
        }
        Trace(pl.DataFrame(columns), {_KEY: facts}).save(path)


def load_excitation(path: Path) -> Excitation:
    """Load an excitation.

    Raises:
        TraceError: The file is missing, foreign or no excitation.
    """
    trace = Trace.load(path)
    facts = trace.header.get(_KEY)
    if facts is None:
        raise TraceError(f"{path} is no excitation; write one with `hop excite`.")
    pairs = (PAIRS[f"{quantity}_command"] for quantity in ("position", "velocity"))
    position, velocity = (np.column_stack([trace.column(c) for c in pair]) for pair in pairs)
    return Excitation(
        trace.column("time_s"),
        position,
        velocity,
        facts["rig"],
        facts["rate_hz"],
        facts["robot"],
        facts["description"],
    )


def make_excitation(
    template: Template,
    robot: Robot,
    *,
    rate: float = RATE,
    limits: HardwareRange | None = None,
    track_velocity: bool = False,
) -> Excitation:
    """Sample a template and check that the leg can follow it.

    Args:
        template: The trajectory.
        robot: The leg.
        rate: Of the samples, Hz.
        limits: How far the real joints turn.
        track_velocity: Let the velocity targets be the positions' derivative, as in the lab's
            recordings; otherwise they are zero, as the paper says.

    Raises:
        UsageError: The leg cannot follow; names joint, time and limit.
    """
    time = np.arange(round(template.duration * rate)) / rate
    if len(time) < 3:
        raise UsageError(
            f"An excitation of {template.duration:g} s at {rate:g} Hz has {len(time)} samples;"
            " make it longer."
        )
    position = template.joints(robot, time)
    wanted = demand(robot, template.rig, position, rate)
    check_demand(robot, wanted, rate, limits or HardwareRange())
    velocity = wanted.velocity if track_velocity else np.zeros_like(position)
    return Excitation(time, position, velocity, template.rig, rate, robot.name, str(template))


def adapt(
    strokes: Strokes,
    robot: Robot,
    *,
    rate: float = RATE,
    limits: HardwareRange | None = None,
) -> Strokes:
    """Return the strokes as large as the leg can follow: the paper's grid does not fit every leg.

    Amplitudes shrink in steps of 5 %, and the leg stays ``LAB_MARGIN`` from straight, where the
    knee would have to jump.

    Args:
        strokes: The paper's template.
        robot: The leg.
        rate: Of the samples, Hz.
        limits: How far the real joints turn.

    Raises:
        UsageError: A stroke is beyond the leg at any amplitude.
    """
    return Strokes(
        tuple(_adapt_stroke(s, robot, rate, limits or HardwareRange()) for s in strokes.parts)
    )


def _adapt_stroke(stroke: Stroke, robot: Robot, rate: float, limits: HardwareRange) -> Stroke:
    time = np.arange(round(stroke.duration * rate)) / rate
    margin, amplitude = max(stroke.margin, LAB_MARGIN), stroke.amplitude
    while True:
        smaller = stroke.smaller(amplitude, margin)
        try:
            wanted = demand(robot, stroke.rig, smaller.joints(robot, time), rate)
            check_demand(robot, wanted, rate, limits)
        except UsageError:
            amplitude *= _SHRINK
            if amplitude < _SMALLEST:
                raise
        else:
            return smaller
