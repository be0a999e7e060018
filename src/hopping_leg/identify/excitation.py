"""Excitations: targets of the joints over time, in a file that every player reads."""

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import TraceError, UsageError
from hopping_leg.identify.feasibility import HardwareRange, check_demand, demand
from hopping_leg.identify.recording_format import PAIRS, Pair, Rig
from hopping_leg.io import is_number
from hopping_leg.robot import Robot, kinematics
from hopping_leg.trace import Trace


class Template(Protocol):
    """A trajectory of the joints on a rig, its duration in s."""

    @property
    def rig(self) -> Rig: ...  # noqa: D102
    @property
    def duration(self) -> float: ...  # noqa: D102
    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); NaN where the foot is out of reach."""
        ...


def require_positive(**numbers: float | None) -> None:
    """Refuse numbers that are not positive and finite, by name; None passes."""
    for name, value in numbers.items():
        if value is not None and not 0 < value < math.inf:
            raise UsageError(f"'{name}' is {value:g} but must be positive and finite.")


@dataclass(frozen=True)
class Multisine:
    """Harmonics with Schroeder phases around a posture: a flat spectrum with low peaks.

    UsageError says that a number has no meaning.
    """

    centre: Pair = (0.7, -1.4)
    amplitude: Pair = (0.3, 0.4)
    """Largest excursion of hip and knee, rad."""
    lowest: float = 0.1
    """Lowest frequency and spacing of the others, Hz."""
    highest: float = 4.0
    duration: float = 60.0
    """Duration of the trajectory, s."""
    rig: ClassVar[Rig] = "fixed-base"

    def __post_init__(self) -> None:
        require_positive(lowest=self.lowest, duration=self.duration)
        if not self.lowest < self.highest < math.inf:
            raise UsageError(f"'highest' is {self.highest:g} Hz but must exceed 'lowest'.")

    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); hip and knee take turns by harmonic."""
        del robot
        count = math.floor(self.highest / self.lowest + 1e-9)
        orders: Array = np.arange(1.0, count + 1)
        angles = np.empty((len(time), 2))
        for joint in range(2):
            mine = orders[joint::2]
            index = np.arange(len(mine))
            phases = -np.pi * index * (index + 1) / max(1, len(mine))
            one = np.arange(2048) / (2048 * self.lowest)
            wave, whole = (
                np.cos(2 * np.pi * np.multiply.outer(t, mine * self.lowest) + phases).sum(axis=-1)
                for t in (time, one)
            )
            scale = self.amplitude[joint] / max(np.abs(whole).max(), 1e-12)
            fade = np.clip(np.minimum(time, self.duration - time) * self.lowest * 4, 0, 1)
            fade = kinematics.smooth_step(fade)
            angles[:, joint] = self.centre[joint] + fade * scale * wave
        return angles


RATE = 200.0
"""Rate of the paper's recordings, Hz."""
_KEY = "excitation"
_WORDS = ("rig", "robot", "description")
_FACTS = {"rig": "rig", "rate_hz": "rate", "robot": "robot", "description": "description"}


@dataclass(frozen=True)
class Excitation:
    """Targets of the joints' PD over time."""

    time: Array
    """From 0 on, s, (ticks,)."""
    position: Array
    """rad, (ticks, 2)"""
    velocity: Array
    """rad/s, (ticks, 2); zero where only positions are tracked, as the paper says."""
    rig: Rig
    rate: float
    """Hz"""
    robot: str
    """Name of the robot that it was checked for."""
    description: str

    def __len__(self) -> int:
        return len(self.time)

    @property
    def digest(self) -> str:
        """SHA-256 over time, positions and velocities, hex."""
        values = np.column_stack([self.time, self.position, self.velocity])
        return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()

    def save(self, path: Path) -> None:
        """Write a Parquet file, or raise TraceError if that fails."""
        names = (*PAIRS["position_command"], *PAIRS["velocity_command"])
        targets = (*self.position.T, *self.velocity.T)
        columns = {"time_s": self.time} | dict(zip(names, targets, strict=True))
        facts = {name: getattr(self, field) for name, field in _FACTS.items()}
        Trace(pl.DataFrame(columns), {_KEY: facts}).save(path)


def load_excitation(path: Path) -> Excitation:
    """Load an excitation, or raise TraceError if the file is missing, foreign or none."""
    trace = Trace.load(path)
    found = trace.header.get(_KEY)
    facts = found if isinstance(found, dict) else {}
    known = all(isinstance(facts.get(name), str) for name in _WORDS)
    if not known or not is_number(rate := facts.get("rate_hz", 0)) or not rate > 0:
        raise TraceError(f"{path} is no excitation; write one with `hop excite`.")
    pairs = (PAIRS[f"{quantity}_command"] for quantity in ("position", "velocity"))
    position, velocity = (np.column_stack([trace.column(c) for c in pair]) for pair in pairs)
    return Excitation(trace.column("time_s"), position, velocity, *(facts[n] for n in _FACTS))


def make_excitation(
    template: Template,
    robot: Robot,
    *,
    rate: float = RATE,
    limits: HardwareRange | None = None,
    track_velocity: bool = False,
) -> Excitation:
    """Sample a template at a rate, Hz, and check that the leg can follow it.

    With ``track_velocity`` the velocity targets are the positions' derivative, as in the lab's
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
