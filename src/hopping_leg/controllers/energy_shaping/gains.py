"""Gains of energy shaping, the defaults the paper's where it gives any; gain files.

A gain file is one TOML per tuned set, beside the leg it was found on.
"""

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg import errors, io
from hopping_leg.arrays import Array
from hopping_leg.robot.parameters import JOINTS, Robot

Gain = float  # One value for all legs; a search for gains gives one per leg, (n,)


@dataclass(frozen=True)
class ShapingGains:
    """Everything energy shaping can be tuned by.

    A gain with a ``_slope`` grows by it per metre that the command lies above ``reference``.
    """

    k0: Gain = 1.0
    """First value of the gain k."""
    k0_slope: Gain = 0.0
    """Slope of k0, 1/m."""
    exponent: Gain = 2.0
    """Exponent of the update k_j = k_{j-1} (E_d / E_{j-1})^exponent."""
    kp_y: Gain = 10.0
    """Sideways stiffness of the foot on the ground, N/m."""
    kd_y: Gain = 3.0
    """Sideways damping of the foot on the ground, N s/m."""
    push_damping: Gain = 0.0
    """Pull of the push towards its intended leg rate, N s/m."""
    push_rate: Gain = 0.83
    """Intended leg rate at lift-off, m/s."""
    push_rate_slope: Gain = 5.2
    """Slope of ``push_rate``, m/s per m."""
    liftoff_length: Gain = 0.245
    """Leg length at which the push ends, m."""
    liftoff_slope: Gain = 0.4
    """Slope of ``liftoff_length``, m/m."""
    landing_length: Gain = 0.2
    """Leg length in which the foot meets the ground, m."""
    landing_slope: Gain = 0.0
    """Slope of ``landing_length``, m/m."""
    retract_time: Gain = 0.08
    """Time from lift-off to the landing posture, s."""
    hip_stiffness: Gain = 8.8
    """Stiffness of the hip in flight, N m/rad."""
    hip_damping: Gain = 0.3
    """Damping of the hip in flight, N m s/rad."""
    knee_stiffness: Gain = 2.3
    """Stiffness of the knee in flight, N m/rad."""
    knee_damping: Gain = 0.074
    """Damping of the knee in flight, N m s/rad."""
    touchdown_stiffness: Gain = 300.0
    """Stiffness along the leg, N/m."""
    touchdown_damping: Gain = 60.0
    """Damping along the leg, N s/m."""
    touchdown_rate: Gain = -0.39
    """Leg rate, less that of the retraction, that gives the ground away, m/s."""
    touchdown_force: Gain = 1000.0
    """Force along the leg that does so too: what the flight PD needs to keep it extended, N."""
    flight_min: Gain = 0.05
    """Contact is not believed earlier than this after lift-off, s."""
    flight_min_slope: Gain = 0.0
    """Slope of ``flight_min``, s/m."""
    height_offset: Gain = 0.0
    """Added to the estimated apex, m."""
    height_scale: Gain = 1.0
    """Stretches the estimated apex about ``reference``."""
    position_pull: Gain = 0.15
    """Pull of the dated observer towards each measured position."""
    reference: Gain = 0.3
    """Command about which the affine gains are written, m."""


POWERS_OF_SIZE = {
    "liftoff_length": 1.0, "landing_length": 1.0, "height_offset": 1.0, "reference": 1.0,
    "k0_slope": -1.0, "retract_time": 0.5, "flight_min": 0.5, "push_rate": 0.5,
    "touchdown_rate": 0.5, "flight_min_slope": -0.5, "push_rate_slope": -0.5,
}  # fmt: skip
"""Gains that grow with a power of the leg's size."""
FORCES: tuple[str, ...] = ("kp_y", "kd_y", "push_damping")
FORCES += ("touchdown_stiffness", "touchdown_damping", "touchdown_force")
"""Gains that grow with the leg's mass."""


def scale_gains(gains: ShapingGains, origin: Robot, robot: Robot) -> ShapingGains:
    """Carry gains over from the leg ``origin`` to another.

    Lengths grow with its size, forces with its mass, times and speeds with the root of its size
    as those of a fall do, and the flight PD with its inertia, less what its joints damp anyway.
    """
    size = (robot.thigh.length + robot.shank.length) / (origin.thigh.length + origin.shank.length)
    factors = {name: size**power for name, power in POWERS_OF_SIZE.items()}
    factors |= dict.fromkeys(FORCES, robot.mass / origin.mass)
    scaled = {name: getattr(gains, name) * factor for name, factor in factors.items()}
    inertia = _joint_inertia(robot) / _joint_inertia(origin)
    for joint, factor in zip(JOINTS, inertia, strict=True):
        scaled[f"{joint}_stiffness"] = getattr(gains, f"{joint}_stiffness") * factor
        damped = getattr(gains, f"{joint}_damping") + getattr(origin, joint).damping
        scaled[f"{joint}_damping"] = np.maximum(
            damped * factor - getattr(robot, joint).damping, 0.0
        )
    return replace(gains, **scaled)


def _joint_inertia(robot: Robot) -> Array:
    """Return the inertia about hip and knee with the knee bent by a right angle, kg m2, (2,)."""
    thigh, shank = robot.thigh, robot.shank
    knee = shank.inertia + shank.mass * shank.com**2
    hip = thigh.inertia + thigh.mass * thigh.com**2 + knee + shank.mass * thigh.length**2
    return np.array([hip, knee]) + robot.of_joints("armature")


_SHIPPED = resources.files("hopping_leg.controllers") / "gains"
TUNED = "energy-shaping"  # name of the shipped set


@dataclass(frozen=True)
class GainFile:
    """A tuned set."""

    robot: str
    """Name or path of the leg it was found on."""
    source: str
    """How it was found."""
    gains: ShapingGains


def load_gains(name_or_path: str | Path = TUNED, robot: Robot | None = None) -> GainFile:
    """Load a shipped set, a robot's own if it has one, or a TOML file, or raise UsageError."""
    name = str(name_or_path)
    source: Any = Path(name) if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    own = _SHIPPED / f"{name}-{robot.name}.toml" if robot else source
    source = own if own.is_file() else source
    try:
        content = source.read_bytes()
    except OSError as error:
        raise errors.UsageError(
            f"There is no gain file {source}; write one with"
            " `python -m studies.energy_shaping.tune`."
        ) from error
    tree = io.parse_toml(content, str(source))
    if "extends" in tree or "thigh" in tree:
        raise errors.UsageError(f"{name} is a robot file, no controller; give it with --robot.")
    return io.read_dataclass(GainFile, tree, name)
