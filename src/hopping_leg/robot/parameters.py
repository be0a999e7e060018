"""What the leg is: typed parameters of one robot, SI units, immutable."""

import dataclasses
import hashlib
import itertools
import json
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.io import quantity
from hopping_leg.robot.hardware import Hardware
from hopping_leg.robot.model_mismatch import NO_MISMATCH, ModelMismatch

JOINTS = ("hip", "knee")
"""Actuated joints, in the order of every pair in this package."""

DEFAULT_STOPS = {"hip": float(np.pi), "knee": 2.7}
"""Where the joints of a leg whose file states no mechanical stops end, rad to either side: what
recordings of leg V2 show."""

PAPER_HEIGHT = 0.30
"""Height of the paper's leg with the leg straight, m: commands and lengths that grow with a leg are
for one of it."""


@dataclass(frozen=True)
class Base:
    """The carriage on the rail: slider and hip motor."""

    mass: float = field(metadata={"unit": "kg"})
    radius: float = field(metadata={"unit": "m"})
    """Radius of the sphere that touches the ground."""


@dataclass(frozen=True)
class Rail:
    """The passive vertical rail."""

    friction: float = field(metadata={"unit": "N", "zero": True})
    """Coulomb friction."""
    damping: float = field(metadata={"unit": "N s/m", "zero": True})


@dataclass(frozen=True)
class Boom:
    """A boom that carries the leg instead of the rail: the base moves on an arc, and forward.

    Its masses resist the leg at the tip by (m r^2 + I) / R^2, up and forward, and weigh g m r / R
    there. Mass, forward mass and weight are what there is beyond them.
    """

    radius: float = quantity("m", 0.0, zero=True)
    """R, from the pivot to the leg; zero where the leg is on the rail."""
    pivot: float = quantity("m", 0.0, zero=True)
    """Height of the pivot above the ground."""
    slider: float = quantity("kg", 0.0, zero=True)
    """What of the base's mass stays on the rail."""
    mass: float = quantity("kg", 0.0, signed=True)
    forward_mass: float = quantity("kg", 0.0, signed=True)
    weight: float = quantity("N", 0.0, signed=True)
    hip_friction: float = quantity("N m", 0.0, zero=True)
    """Coulomb friction that the mounting adds at the hip, e.g. by cables and a loaded axle."""
    friction: float = quantity("N", 0.0, zero=True)
    """Coulomb friction of its joints, at the tip."""
    damping: float = quantity("N s/m", 0.0, zero=True)
    masses: tuple[tuple[float, float, float], ...] = ()
    """Of each part without the leg: mass m, kg, distance r from the pivot, m, negative for a
    counterweight, and inertia I about its centre of mass, kg m2."""

    def __add__(self, other: "Boom") -> "Boom":
        """Return this boom with what another one has beyond its masses."""
        names = ("mass", "forward_mass", "weight", "hip_friction", "friction", "damping")
        more = {name: getattr(self, name) + getattr(other, name) for name in names}
        return dataclasses.replace(self, **more)

    @property
    def inertia(self) -> float:
        """What its masses resist with at the tip, kg."""
        return sum(m * r * r + i for m, r, i in self.masses) / max(self.radius, 1e-9) ** 2

    @property
    def moment(self) -> float:
        """What its masses hang at the tip, kg."""
        return sum(m * r for m, r, _ in self.masses) / max(self.radius, 1e-9)


@dataclass(frozen=True)
class Link:
    """A rigid link that swings in the leg's plane."""

    length: float = field(metadata={"unit": "m"})
    mass: float = field(metadata={"unit": "kg"})
    com: float = field(metadata={"unit": "m"})
    """Distance of the centre of mass from the link's upper joint, along the link."""
    inertia: float = field(metadata={"unit": "kg m2"})
    """Inertia about the centre of mass, around the joint's axis (the paper's Z)."""
    extent: float = quantity("m", 0.0, zero=True)
    """How far from the upper joint its mass reaches where a weight sticks out beyond its end. No
    physics depends on it: it says where the centre of mass may be, and how large the inertia."""

    @property
    def reach(self) -> float:
        """How far from the upper joint its mass reaches, m."""
        return max(self.length, self.extent)


@dataclass(frozen=True)
class Ball:
    """A sphere that may touch the ground."""

    radius: float = field(metadata={"unit": "m"})


@dataclass(frozen=True)
class Contact:
    """The ground as MuJoCo's mass-spring-damper constraint (``solref``)."""

    time_constant: float = field(metadata={"unit": "s"})
    damping_ratio: float = field(metadata={"unit": "1"})
    friction: float = field(metadata={"unit": "1", "zero": True})


@dataclass(frozen=True)
class Motor:
    """A geared motor; everything but ``rotor_inertia`` is at the gear's output."""

    gear_ratio: float = field(metadata={"unit": "1"})
    rotor_inertia: float = field(metadata={"unit": "kg m2"})
    """Inertia of the rotor itself, before the gear."""
    torque_limit: float = field(metadata={"unit": "N m"})
    """Largest torque that the software allows."""
    peak_torque: float = field(metadata={"unit": "N m"})
    """Stall torque; the torque-speed line falls from here to zero at ``no_load_speed``."""
    rated_torque: float = field(metadata={"unit": "N m"})
    """Torque that the motor gives continuously."""
    no_load_speed: float = field(metadata={"unit": "rad/s"})


@dataclass(frozen=True)
class Joint:
    """An actuated joint behind a motor and a belt."""

    friction: float = field(metadata={"unit": "N m", "zero": True})
    """Coulomb friction."""
    damping: float = field(metadata={"unit": "N m s/rad", "zero": True})
    belt_ratio: float = field(metadata={"unit": "1"})
    """Turns of the motor's output per turn of the joint."""
    lower: float = field(metadata={"unit": "rad", "signed": True})
    """Soft limit q^l of the paper."""
    upper: float = field(metadata={"unit": "rad", "signed": True})
    """Soft limit q^h of the paper."""
    motor: Motor
    armature: float = quantity("kg m2", float("nan"))
    """Reflected inertia at the joint; a file without it gets what rotor, gear and belt give."""
    load_friction: float = quantity("1", 0.0, zero=True)
    """Gear loss: further Coulomb friction per torque that the motor gives."""
    torque_gain: float = quantity("1", 1.0)
    """Torque that the motor gives per torque asked for, within its limits."""
    stop_lower: float = quantity("rad", float("nan"), signed=True)
    """Lower mechanical stop; a leg's file without it gets leg V2's, a pendulum's none within a
    turn of its soft limits."""
    stop_upper: float = quantity("rad", float("nan"), signed=True)
    """Upper mechanical stop, see ``stop_lower``."""

    def __post_init__(self) -> None:
        if np.isnan(self.armature):
            ratio = self.motor.gear_ratio * self.belt_ratio
            object.__setattr__(self, "armature", self.motor.rotor_inertia * ratio**2)

    @property
    def torque_limit(self) -> float:
        """Largest torque at the joint, N m."""
        return self.motor.torque_limit * self.belt_ratio

    @property
    def no_load_speed(self) -> float:
        """Speed at which the motor has no torque left, at the joint, rad/s."""
        return self.motor.no_load_speed / self.belt_ratio


@dataclass(frozen=True)
class Robot:
    """One leg. Angles: hip 0 is straight down, knee is relative to the thigh, 0 is straight."""

    name: str
    base: Base
    rail: Rail
    thigh: Link
    shank: Link
    knee_cap: Ball
    foot: Ball
    contact: Contact
    hip: Joint
    knee: Joint
    description: str = ""
    boom: Boom = field(default_factory=Boom)
    """What carries the leg, if it is no rail."""
    kind: Literal["leg", "pendulum"] = "leg"
    """``leg``, whose knee bends to the negative side, or ``pendulum``, which swings freely."""
    reality: ModelMismatch = field(default_factory=ModelMismatch)
    """What the real leg does beyond this; simulated by ``hopping_leg.sim``, unknown to control."""
    hardware: Hardware = field(default_factory=Hardware)
    """How the drives are wired; used by ``hopping_leg.deploy`` alone."""

    def __post_init__(self) -> None:
        for name, reach in DEFAULT_STOPS.items():
            joint: Joint = getattr(self, name)
            lower, upper = -reach, reach
            if self.kind == "pendulum":
                lower, upper = joint.lower - 2 * np.pi, joint.upper + 2 * np.pi
            lower = lower if np.isnan(joint.stop_lower) else joint.stop_lower
            upper = upper if np.isnan(joint.stop_upper) else joint.stop_upper
            complete = dataclasses.replace(joint, stop_lower=lower, stop_upper=upper)
            object.__setattr__(self, name, complete)

    @property
    def mass(self) -> float:
        """Everything that moves on the rail, kg."""
        return self.base.mass + self.thigh.mass + self.shank.mass

    @property
    def straight_height(self) -> float:
        """Height of the hip axis with the leg straight and the foot on the ground, m."""
        return self.thigh.length + self.shank.length + self.foot.radius

    @property
    def size(self) -> float:
        """Straight height over that of the paper's leg."""
        return self.straight_height / PAPER_HEIGHT

    def require_leg(self) -> None:
        """Refuse a pendulum, where a robot has to stand or hop, by a RobotError."""
        if self.kind != "leg":
            raise RobotError(
                f"{self.name} is a {self.kind} and cannot hop; name a leg, e.g. legv2, or use it"
                " for identification only."
            )

    def of_joints(self, attribute: str) -> Array:
        """Return a joint attribute of hip and knee, (2,)."""
        return np.array([getattr(self.hip, attribute), getattr(self.knee, attribute)])

    @property
    def digest(self) -> str:
        """Hash of every parameter that the physics depends on: 16 hex digits."""
        return self._digest()

    def has_digest(self, digest: str) -> bool:
        """Tell whether a stored digest is this leg's; it may leave the mechanical stops out."""
        return digest in (self.digest, self._digest("stop_lower", "stop_upper"))

    def _digest(self, *without: str) -> str:
        values = dataclasses.asdict(self)
        del values["name"], values["description"], values["kind"], values["hardware"]
        if self.reality == NO_MISMATCH:
            del values["reality"]
        if self.boom == Boom():
            del values["boom"]
        for link in ("thigh", "shank"):
            del values[link]["extent"]
        for joint, name in itertools.product(JOINTS, ("load_friction", "torque_gain")):
            if values[joint][name] == Joint.__dataclass_fields__[name].default:
                del values[joint][name]
        for joint, name in itertools.product(JOINTS, without):
            del values[joint][name]
        text = json.dumps(values, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]
