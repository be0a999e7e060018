"""What a real leg does that the simulator for training does not know; every default is neutral.

A robot file states it in the table ``[reality]``. The rest of the file stays what controllers and
training believe; only ``hopping_leg.sim`` makes the leg behave as stated here.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hopping_leg.arrays import Array


def _value(default: float | None, unit: str) -> Any:  # noqa: ANN401
    """Return a field that may be left out; zero and more are valid."""
    return field(default=default, metadata={"unit": unit, "zero": True})


def _positive(default: float | None, unit: str) -> Any:  # noqa: ANN401
    """Return a field that may be left out; zero is not valid."""
    return field(default=default, metadata={"unit": unit})


@dataclass(frozen=True)
class Latency:
    """Time between the controller and the leg, in whole physics steps when simulated."""

    command: float = _value(0.0, "s")
    """From the controller's decision to the motor's torque."""
    measurement: float = _value(0.0, "s")
    """Age of the newest measurement when the controller gets it."""
    jitter: float = _value(0.0, "s")
    """Each command is late by a further time, uniform between zero and this."""


@dataclass(frozen=True)
class SensorMismatch:
    """Encoder and torque measurement of one joint, at the joint's side."""

    position_step: float = _value(0.0, "rad")
    """Quantisation; zero has none."""
    velocity_step: float = _value(0.0, "rad/s")
    torque_step: float = _value(0.0, "N m")
    position_noise: float = _value(0.0, "rad")
    """Standard deviation of white noise, added before quantisation."""
    velocity_noise: float = _value(0.0, "rad/s")
    torque_noise: float = _value(0.0, "N m")


@dataclass(frozen=True)
class DriveMismatch:
    """Motor, gear and belt of one joint; all numbers at the joint's side."""

    torque_limit: float | None = _positive(None, "N m")
    """Where the motor saturates; without it, where the software limits."""
    torque_gain: float = _positive(1.0, "1")
    """Motor torque over commanded torque; the torque measurement shows it."""
    torque_lag: float = _value(0.0, "s")
    """Time constant with which the motor torque follows, of first order."""
    ripple: float = _value(0.0, "N m")
    """Amplitude of the torque that depends on the motor's angle (cogging)."""
    ripple_periods: float = _positive(1.0, "1")
    """Periods of the ripple per turn of the joint."""
    efficiency: float = _positive(1.0, "1")
    """Efficiency of the gear in both directions of power, which measured torque does not show."""
    stiction: float = _positive(1.0, "1")
    """Friction at rest over the joint's Coulomb friction."""
    stiction_speed: float = _positive(0.05, "rad/s")
    """Speed at which friction has fallen to Coulomb's (Stribeck)."""
    backlash: float = _value(0.0, "rad")
    """Whole width of the dead band between motor and link."""
    stiffness: float | None = _positive(None, "N m/rad")
    """Stiffness of the belt between motor and link; without it, rigid."""
    stiffness_damping: float = _value(0.0, "N m s/rad")
    """Damping between motor and link, beside the stiffness."""
    sensor: SensorMismatch = field(default_factory=SensorMismatch)


@dataclass(frozen=True)
class MassScale:
    """True mass over the file's; a link's inertia scales along."""

    base: float = _positive(1.0, "1")
    thigh: float = _positive(1.0, "1")
    shank: float = _positive(1.0, "1")


@dataclass(frozen=True)
class GroundMismatch:
    """The true ground, where it differs from ``[contact]``."""

    time_constant: float | None = _positive(None, "s")
    damping_ratio: float | None = _positive(None, "1")
    friction: float | None = _positive(None, "1")


@dataclass(frozen=True)
class ModelMismatch:
    """Every effect that the simulator for training does not know."""

    voltage: float = _positive(1.0, "1")
    """Battery over the voltage that the motors' peak torque and no-load speed belong to."""
    latency: Latency = field(default_factory=Latency)
    hip: DriveMismatch = field(default_factory=DriveMismatch)
    knee: DriveMismatch = field(default_factory=DriveMismatch)
    mass: MassScale = field(default_factory=MassScale)
    ground: GroundMismatch = field(default_factory=GroundMismatch)

    @property
    def neutral(self) -> bool:
        """Whether the leg behaves as the simulator for training has it."""
        return self == NO_MISMATCH

    @property
    def only_delays(self) -> bool:
        """Whether nothing but a constant delay of commands is left, which training can simulate."""
        return self == replace(NO_MISMATCH, latency=Latency(command=self.latency.command))

    def of_drives(self, attribute: str) -> Array:
        """Return an attribute of both drives, (2,); NaN where it is None."""
        return np.array([getattr(d, attribute) for d in (self.hip, self.knee)], dtype=np.float64)

    def of_sensors(self, attribute: str) -> Array:
        """Return an attribute of both joints' sensors, (2,)."""
        return np.array([getattr(d.sensor, attribute) for d in (self.hip, self.knee)])


NO_MISMATCH = ModelMismatch()
"""Nothing that the simulator for training does not know."""
