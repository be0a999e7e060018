"""Excitations: targets of the joints over time, in a file that every player reads.

Before one is made it is checked whether the leg can follow: reach, joint range, speed, torque.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.errors import TraceError, UsageError
from hopping_leg.identify.recording_format import PAIRS, Pair, Rig
from hopping_leg.io import is_number
from hopping_leg.robot import JOINTS, MotorLimit, Robot, dynamics, kinematics
from hopping_leg.trace import Trace

LEAST_CLEARANCE = 0.005  # of base and knee above the ground, m


class Demand(NamedTuple):
    """What a trajectory asks of the joints, rad, rad/s and N m, (ticks, 2) each."""

    position: Array
    velocity: Array
    torque: Array


class Template(Protocol):
    """A trajectory of the joints on a rig, its duration in s."""

    @property
    def rig(self) -> Rig: ...  # noqa: D102
    @property
    def duration(self) -> float: ...  # noqa: D102
    def joints(self, robot: Robot, time: Array) -> Array:
        """Return joint angles at times, rad, (ticks, 2); NaN where the foot is out of reach."""
        ...


def inverse_dynamics(robot: Robot, rig: Rig, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the joint torques, N m, of joint angles, velocities and accelerations, (..., 2) each.

    With a moving base the foot presses on flat, hard ground with the force F that the motion
    takes, without horizontal force; where F would pull, the leg flies. Landing impacts are not
    part of this.
    """
    mass, bias = dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, qd)
    torque: Array = np.einsum("...ij,...j->...i", mass[..., 1:, 1:], qdd) + bias[..., 1:]
    if rig != "fixed-base":
        down = kinematics.jacobian(robot, q)[..., 0, :]
        inner = np.vecdot(mass[..., 0, 1:], qdd) + bias[..., 0]
        angle, speed = np.cumsum(q, axis=-1), np.cumsum(qd, axis=-1)
        lengths = np.array([robot.thigh.length, robot.shank.length])
        climb = np.vecdot(down, qdd) - np.vecdot(np.cos(angle) * speed**2, lengths)
        force = np.maximum(mass[..., 0, 0] * climb + inner, 0.0)
        climb = (force - inner) / mass[..., 0, 0]
        torque += mass[..., 1:, 0] * climb[..., None] + down * force[..., None]
    torque += robot.of_joints("friction") * np.sign(qd) + robot.of_joints("damping") * qd
    return torque


def demand(robot: Robot, rig: Rig, position: Array, rate: float) -> Demand:
    """Return what a trajectory, rad, (ticks, 2), sampled at a rate in Hz, asks of the joints."""
    velocity = np.gradient(position, 1 / rate, axis=0)
    inner = np.diff(position, 2, axis=0) * rate**2
    acceleration = np.pad(inner, ((1, 1), (0, 0)), mode="edge")
    torque = inverse_dynamics(robot, rig, position, velocity, acceleration)
    return Demand(position, velocity, torque)


def possible_demand(template: Template, robot: Robot, rate: float) -> tuple[Array, Demand]:
    """Sample a template at a rate, Hz; return times, s, and what it asks of the joints.

    UsageError says at which joint and time the leg cannot follow, for reach, stops, ground or the
    motors' torque-speed lines.
    """
    time = np.arange(round(template.duration * rate)) / rate
    if len(time) < 3:
        raise UsageError(f"The excitation has only {len(time)} samples; make it longer.")
    wanted = demand(robot, template.rig, template.joints(robot, time), rate)
    q, speed, torque = wanted
    height = kinematics.stance_height(robot, q)
    ground = (kinematics.base_clearance(robot, height), kinematics.knee_clearance(robot, height, q))
    clearance = np.stack(ground, axis=1) + (np.inf if template.rig == "fixed-base" else 0.0)
    low, high = robot.of_joints("stop_lower"), robot.of_joints("stop_upper")
    fastest, possible = robot.of_joints("no_load_speed"), MotorLimit(robot).clip(torque, speed)
    outside, low_down = (q < low) | (q > high), clearance < LEAST_CLEARANCE
    weak = "{:.1f} N m at {:.1f} rad/s exceeds the {:.1f} N m that the motor gives"
    for bad, reason, *values in (
        (np.isnan(q), "the foot is out of reach"),
        (outside, "{:.2f} rad is outside of the stops {:g} and {:g} rad", q, low, high),
        (low_down, "base or knee is {:.1f} mm above the ground, too low", 1e3 * clearance),
        (np.abs(speed) > fastest, "{:.1f} rad/s exceeds {:g} rad/s", speed, fastest),
        (np.abs(torque - possible) > 1e-9, weak, torque, speed, possible),
    ):
        if bad.any():
            tick, joint = np.argwhere(bad)[0].tolist()
            facts = [np.broadcast_to(value, bad.shape)[tick, joint] for value in values]
            raise UsageError(
                f"The leg cannot follow the trajectory: at {tick / rate:.3f} s, {JOINTS[joint]}:"
                f" {reason.format(*facts)}; lower the amplitude, slow it down or adapt it."
            )
    return time, wanted


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
        orders: Array = np.arange(1.0, math.floor(self.highest / self.lowest + 1e-9) + 1)
        fade = np.clip(np.minimum(time, self.duration - time) * self.lowest * 4, 0, 1)
        period = np.arange(2048) / (2048 * self.lowest)
        angles = np.empty((len(time), 2))
        for joint in range(2):
            mine = orders[joint::2]
            index = np.arange(len(mine))
            phases = -np.pi * index * (index + 1) / max(1, len(mine))
            wave, whole = (
                np.cos(2 * np.pi * np.multiply.outer(t, mine * self.lowest) + phases).sum(axis=-1)
                for t in (time, period)
            )
            scale = self.amplitude[joint] / max(np.abs(whole).max(), 1e-12)
            angles[:, joint] = self.centre[joint] + kinematics.smooth_step(fade) * scale * wave
        return angles


RATE = 200.0
"""Rate of the paper's recordings, Hz."""
TARGETS = PAIRS["position_command"] + PAIRS["velocity_command"]
"""A recording's columns of targets."""
_KEY = "excitation"
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
    def table(self) -> pl.DataFrame:
        """Time and targets in a recording's columns."""
        targets = np.column_stack([self.time, self.position, self.velocity])
        return pl.DataFrame(targets, ("time_s", *TARGETS))

    def save(self, path: Path) -> None:
        """Write a Parquet file, or raise TraceError if that fails."""
        facts = {name: getattr(self, field) for name, field in _FACTS.items()}
        Trace(self.table, {_KEY: facts}).save(path)


def load_excitation(path: Path) -> Excitation:
    """Load an excitation, or raise TraceError if the file is missing, foreign or none."""
    trace = Trace.load(path)
    facts = trace.header.get(_KEY)
    if not isinstance(facts, dict) or not facts.keys() >= _FACTS.keys():
        raise TraceError(f"{path} is no excitation; write one with `hop record`.")
    if not is_number(facts["rate_hz"]) or not facts["rate_hz"] > 0:
        raise TraceError(f"{path} has no rate; write it again with `hop record`.")
    trace.require_ticks(path)
    targets = np.column_stack([trace.column(name) for name in TARGETS])
    time, facts = trace.column("time_s"), [facts[name] for name in _FACTS]
    return Excitation(time, targets[:, :2], targets[:, 2:], *facts)


def make_excitation(
    template: Template, robot: Robot, *, rate: float = RATE, track_velocity: bool = False
) -> Excitation:
    """Sample a template as ``possible_demand`` does.

    With ``track_velocity`` the velocity targets are the positions' derivative, as in the lab's
    recordings; otherwise they are zero, as the paper says.
    """
    time, (position, velocity, _) = possible_demand(template, robot, rate)
    velocity = velocity if track_velocity else np.zeros_like(velocity)
    return Excitation(time, position, velocity, template.rig, rate, robot.name, str(template))
