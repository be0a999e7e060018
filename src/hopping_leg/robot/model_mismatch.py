"""What a real leg does that the simulator for training does not know; every default is neutral.

A robot file states it in the table ``[reality]``. The rest of the file stays what controllers and
training believe; only ``hopping_leg.sim`` makes the leg behave as stated here.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.io import quantity


@dataclass(frozen=True)
class Latency:
    """Time between the controller and the leg."""

    command: float = quantity("s", 0.0, zero=True)
    """From the controller's decision to the motor's torque."""
    measurement: float = quantity("s", 0.0, zero=True)
    """Age of the newest measurement when the controller gets it."""
    jitter: float = quantity("s", 0.0, zero=True)
    """Each command is late by a further time, uniform between zero and this."""


@dataclass(frozen=True)
class SensorMismatch:
    """Encoder and torque measurement of one joint, at the joint's side."""

    position_step: float = quantity("rad", 0.0, zero=True)
    """Quantisation; zero has none."""
    velocity_step: float = quantity("rad/s", 0.0, zero=True)
    torque_step: float = quantity("N m", 0.0, zero=True)
    position_noise: float = quantity("rad", 0.0, zero=True)
    """Standard deviation of white noise, added before quantisation."""
    velocity_noise: float = quantity("rad/s", 0.0, zero=True)
    torque_noise: float = quantity("N m", 0.0, zero=True)


STANDING_NOISE = (
    SensorMismatch(position_noise=1.4e-4, velocity_noise=0.09, torque_noise=0.06),
    SensorMismatch(position_noise=4e-5, velocity_noise=0.04, torque_noise=0.03),
)
"""Of hip and knee: what leg V2's drives report while it stands still."""


@dataclass(frozen=True)
class DriveMismatch:
    """Motor, gear and belt of one joint; all numbers at the joint's side."""

    torque_limit: float | None = quantity("N m", None)
    """Where the motor saturates; without it, at its peak torque."""
    torque_gain: float = quantity("1", 1.0)
    """Motor torque over commanded torque; the torque measurement shows it."""
    torque_lag: float = quantity("s", 0.0, zero=True)
    """Time constant with which the motor torque follows, of first order."""
    ripple: float = quantity("N m", 0.0, zero=True)
    """Amplitude of the torque that depends on the motor's angle (cogging)."""
    ripple_periods: float = quantity("1", 1.0)
    """Periods of the ripple per turn of the joint."""
    efficiency: float = quantity("1", 1.0)
    """Efficiency of the gear in both directions of power, which measured torque does not show."""
    stiction: float = quantity("1", 1.0)
    """Friction at rest over the joint's Coulomb friction."""
    stiction_speed: float = quantity("rad/s", 0.05)
    """Speed at which friction has fallen to Coulomb's (Stribeck)."""
    backlash: float = quantity("rad", 0.0, zero=True)
    """Whole width of the dead band between motor and link; needs a ``stiffness``."""
    stiffness: float | None = quantity("N m/rad", None)
    """Stiffness of the belt between motor and link; without it, rigid."""
    stiffness_damping: float = quantity("N m s/rad", 0.0, zero=True)
    """Damping between motor and link, beside the stiffness."""
    sensor: SensorMismatch = field(default_factory=SensorMismatch)


@dataclass(frozen=True)
class MassScale:
    """True mass over the file's; a link's inertia scales along."""

    base: float = quantity("1", 1.0)
    thigh: float = quantity("1", 1.0)
    shank: float = quantity("1", 1.0)


@dataclass(frozen=True)
class GroundMismatch:
    """The true ground, where it differs from ``[contact]``."""

    time_constant: float | None = quantity("s", None)
    damping_ratio: float | None = quantity("1", None)
    friction: float | None = quantity("1", None, zero=True)


@dataclass(frozen=True)
class ModelMismatch:
    """Every effect that the simulator for training does not know."""

    voltage: float = quantity("1", 1.0)
    """Battery over the voltage that the motors' peak torque and no-load speed belong to."""
    latency: Latency = field(default_factory=Latency)
    hip: DriveMismatch = field(default_factory=DriveMismatch)
    knee: DriveMismatch = field(default_factory=DriveMismatch)
    mass: MassScale = field(default_factory=MassScale)
    ground: GroundMismatch = field(default_factory=GroundMismatch)

    @property
    def in_training(self) -> "ModelMismatch":
        """What of it training simulates: transmissions with losses, delay, jitter of commands."""
        kept = ("backlash", "stiffness", "stiffness_damping", "efficiency")
        drives = (self.hip, self.knee)
        hip, knee = (DriveMismatch(**{k: getattr(d, k) for k in kept}) for d in drives)
        return ModelMismatch(latency=replace(self.latency, measurement=0.0), hip=hip, knee=knee)

    def of_drives(self, attribute: str) -> Array:
        """Return an attribute of both drives, (2,); NaN where it is None."""
        return np.array([getattr(d, attribute) for d in (self.hip, self.knee)], dtype=np.float64)

    def of_sensors(self, attribute: str) -> Array:
        """Return an attribute of both joints' sensors, (2,)."""
        return np.array([getattr(d.sensor, attribute) for d in (self.hip, self.knee)])


NO_MISMATCH = ModelMismatch()  # Nothing that the simulator for training does not know
