"""Legs of any size: robot files of legs that nobody built, and what such a leg may really be.

A leg is a shipped one, or leg V2 with other links, masses, motors and gears. What its file says of
friction, inertia, rail and ground may be a guess as good as a CAD's, or identified; payload, gains
of the motors, delay, transmission, voltage and noise it never says. Ranges are leg V2's; numbers
with units grow with another leg's length and mass, gravity staying the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import attrgetter

import numpy as np

from hopping_leg.io import Tree, replace_at
from hopping_leg.robot import (
    JOINTS,
    Link,
    Robot,
    load_robot,
    load_tree,
    numbers,
    robot_from_tree,
)
from hopping_leg.sim.leg_table import stiffest
from hopping_leg.sim.randomization import Range, Twin, times

BASE = "legv2"
"""The leg whose size everything is measured by."""


SIZES = (
    *(times(f"{link}.length", 0.7, 1.5) for link in ("thigh", "shank")),
    *(times(f"{body}.mass", 0.5, 2.0) for body in ("base", "thigh", "shank")),
)
"""Links and masses over leg V2's."""

GROUND = (
    Range("contact.time_constant", "1", 0.005, 0.18, "[C] to twice Table I", "logarithmic"),
    Range("contact.damping_ratio", "1", 0.5, 1.4, "[C]", "logarithmic"),
    Range("contact.friction", "1", 0.6, 1.2, "[C]"),
)
"""From hard to soft; the same for any leg."""

FRICTION = (
    Range("rail.friction", "N", 0.0, 1.6, "[C] none to twice Table I"),
    Range("rail.damping", "N s/m", 0.0, 2.0, "[C] none to twice Table I"),
    Range("hip.friction", "N m", 0.02, 0.6, "[C]", "logarithmic"),
    Range("hip.damping", "N m s/rad", 3e-4, 2e-2, "[C]", "logarithmic"),
    Range("knee.friction", "N m", 1e-3, 0.35, "[C]", "logarithmic"),
    Range("knee.damping", "N m s/rad", 8e-3, 0.2, "[C]", "logarithmic"),
)

RUBBING = tuple(
    Range(f"{joint}.friction", "N m", 0.05, 4.0, "[C] to far above Table I", "logarithmic")
    for joint in JOINTS
)
"""Friction of joints that rub more than any fit has found."""

INERTIA = (
    times("thigh.inertia", 0.8, 3.6),
    times("shank.inertia", 0.8, 10.0),
    times("thigh.com", 0.8, 2.2),
    times("shank.com", 0.85, 1.2),
    times("hip.armature", 0.7, 1.9),
    times("knee.armature", 0.6, 2.4),
)
"""What a fit finds, over the CAD: as far off as Table I and the recordings are."""

SMALL_ARMATURE = (
    Range("hip.armature", "kg m2", 3e-5, 6e-4, "[P] Table I, and more", "logarithmic"),
    Range("knee.armature", "kg m2", 8e-5, 3e-3, "[P] Table I, and more", "logarithmic"),
)

MASSES = (
    times("base.mass", 0.7, 1.6),
    *(times(f"{link}.mass", 0.92, 1.08) for link in ("thigh", "shank")),
)
"""Payload, and what was not weighed."""

GAINS = tuple(times(f"{joint}.torque_gain", 1 / 1.3, 1.3) for joint in JOINTS)
WEAK = (times("hip.torque_gain", 0.42, 1 / 1.3),)
"""Of hips that give far less than they are asked for."""

TRANSMISSIONS = (
    Range("reality.hip.stiffness", "N m/rad", 600.0, 3000.0, "[C]", "logarithmic"),
    Range("reality.hip.stiffness_damping", "N m s/rad", 0.02, 0.12, "[C]"),
    Range("reality.hip.backlash", "rad", 0.0, 8e-3, "[C]"),
    Range("reality.knee.stiffness", "N m/rad", 130.0, 900.0, "[C]", "logarithmic"),
    Range("reality.knee.stiffness_damping", "N m s/rad", 0.01, 0.06, "[C]"),
    Range("reality.knee.backlash", "rad", 0.0, 5e-3, "[C]"),
)

WORN = (
    Range("reality.hip.backlash", "rad", 4e-3, 0.2, "[C]", "logarithmic"),
    Range("reality.knee.backlash", "rad", 2e-3, 0.2, "[C]", "logarithmic"),
)
"""Backlash of worn transmissions."""

EMPTY = (Range("reality.voltage", "1", 0.4, 1.0, "[C] to below an empty battery"),)

NOISES = tuple(
    Range(f"reality.{joint}.sensor.{kind}_noise", unit, low, high, "[C]", "logarithmic")
    for joint in JOINTS
    for kind, unit, low, high in (
        ("position", "rad", 5e-3, 0.4),
        ("velocity", "rad/s", 0.05, 4.0),
    )
)
"""On top of the paper's."""

_TORQUES = ("torque_limit", "peak_torque", "rated_torque")
_SHAPE, _TORQUE, _SPEED, _GEAR = (0.8, 1.25), (0.75, 1.5), (0.9, 1.5), (0.6, 1.6)
"""Over leg V2's, scaled: centres of mass and inertias, torques, no-load speeds, armatures."""

_WEAKEST, _STRONGEST = 0.4, 3.0  # weight times length over leg V2's that motors are sized for

# Shares of the legs of a training.
_SCALED = 0.55  # of another size than leg V2
_PLAIN = 0.15  # as designed, but for gains, delay and transmission
_FITTED = ("legv2-identified", "legv2-paper")
_SHIPPED = (BASE, BASE, *_FITTED, "legv1")  # designs of the others
_RUBBING = 0.3  # with more friction in their joints than most
_SMALL = 0.1  # with an armature below that of rotor and gear
_IDENTIFIED = 0.5  # told as a fit would tell them
_EXACT = 0.2  # whose motors give what is asked for
_WEAK = 0.15  # of the others: whose hip gives far less
_PUNCTUAL, _SOON = 0.15, 0.5  # without delay, and late by less than a control period
_ELASTIC = 0.6
_WORN = 0.2  # of the elastic ones
_EMPTY = 0.1
_NOISY = 0.1  # that have noise of their own

_LEAST_ARMATURE = 1e-3
"""Behind which there may be an elastic transmission, on a leg of leg V2's size, kg m2."""

_PERIOD, _LATEST = 0.005, 0.015  # delays, s
_FIT_ERROR = 0.08  # standard deviation of what a fit tells, relative
_STEP = 5e-4
"""Physics step with which a transmission must be simulated, s."""


@cache
def _base() -> Robot:
    return load_robot(BASE)


@dataclass(frozen=True)
class TaskLeg:
    """One leg of a task in which legs differ."""

    believed: Robot
    """What is told of it."""
    true: Robot
    """What it is."""
    command_range: tuple[float, float] = (math.nan, math.nan)
    """Desired heights that it reaches, m."""


def draw_leg(seed: int) -> Twin:
    """Draw a leg of any size whose file tells all of it; the same seed gives the same leg."""
    rng, base = np.random.default_rng([seed, 0]), _base()
    robot = _draw(_scale(base, rng), (*GROUND, *FRICTION), rng)
    for name in JOINTS:  # motors are no stronger than the currents of their drives make them
        motor, servo = getattr(robot, name).motor, getattr(robot.hardware, name)
        most = servo.torque_constant * servo.max_current * motor.gear_ratio
        share = min(most / motor.peak_torque, 1.0)
        for torque in _TORQUES:
            robot = replace_at(robot, f"{name}.motor.{torque}", share * getattr(motor, torque))
    tree: Tree = {"name": f"leg-{seed}", "description": f"leg {seed}, drawn"}
    armatures = {f"{joint}.armature": {"value": 0.0, "unit": "kg m2"} for joint in JOINTS}
    for path, entry in (*numbers(load_tree(BASE)), *armatures.items()):
        value = attrgetter(path)(robot)
        if value != entry["value"]:
            drawn = {"value": float(f"{value:.6g}"), "source": f"drawn with seed {seed}"}
            entry = {**entry, **drawn}
        tree = replace_at(tree, path, entry)
    return Twin(robot_from_tree(tree, f"leg {seed}"), tree)


def draw_any_leg(seed: int) -> TaskLeg:
    """Draw a leg of a training, heights left open; the same seed gives the same leg."""
    rng = np.random.default_rng([seed, 1])
    shipped = load_robot(_SHIPPED[rng.integers(len(_SHIPPED))])
    design = _scale(_base(), rng) if rng.random() < _SCALED else shipped
    true = design
    if rng.random() >= _PLAIN:
        inertia = () if design.name in _FITTED else INERTIA
        true = _draw(design, (*GROUND, *FRICTION, *inertia, *MASSES), rng)
        if rng.random() < _RUBBING:
            true = _draw(true, RUBBING, rng)
        if rng.random() < _SMALL:
            true = _draw(true, SMALL_ARMATURE, rng)
    told = _fitted(design, true, rng) if rng.random() < _IDENTIFIED else design
    believed = replace(told, reality=_base().reality)
    if rng.random() >= _EXACT:
        true = _draw(true, GAINS if rng.random() >= _WEAK else (*WEAK, GAINS[1]), rng)
    share = rng.random()
    latest = _PERIOD if share < _PUNCTUAL + _SOON else _LATEST
    seconds = 0.0 if share < _PUNCTUAL else float(rng.uniform(0.0, latest))
    true = replace_at(true, "reality.latency.command", seconds)
    heavy = min(true.hip.armature, true.knee.armature) > _LEAST_ARMATURE * _unit(
        "kg m2", *_ratios(true)
    )
    if rng.random() < _ELASTIC and heavy:
        true = _draw(true, TRANSMISSIONS, rng)
        for name in JOINTS:  # no stiffer than a training can simulate
            path, most = f"reality.{name}.stiffness", 0.5 * stiffest(true, name, _STEP)
            true = replace_at(true, path, min(attrgetter(path)(true), most))
        if rng.random() < _WORN:
            true = _draw(true, WORN, rng)
    if rng.random() < _EMPTY:
        true = _draw(true, EMPTY, rng)
    if rng.random() < _NOISY:
        true = _draw(true, NOISES, rng)
    return TaskLeg(believed, true)


def _scale(base: Robot, rng: np.random.Generator) -> Robot:
    """Return the leg with other links and masses, and motors that fit these more or less."""

    def factor(ends: tuple[float, float]) -> float:
        return math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))

    def shaped(link: Link, old: Link) -> Link:
        longer, heavier = link.length / old.length, link.mass / old.mass
        com = old.com * longer * factor(_SHAPE)
        return replace(link, com=com, inertia=old.inertia * heavier * longer**2 * factor(_SHAPE))

    robot = _draw(base, SIZES, rng)
    thigh, shank = shaped(robot.thigh, base.thigh), shaped(robot.shank, base.shank)
    robot = replace(robot, thigh=thigh, shank=shank)
    smaller = min(thigh.length / base.thigh.length, shank.length / base.shank.length)
    for ball in ("base", "knee_cap", "foot"):
        robot = replace_at(robot, f"{ball}.radius", getattr(base, ball).radius * smaller)
    length, mass = _ratios(robot)
    strength = min(max(length * mass, _WEAKEST), _STRONGEST)
    for name in JOINTS:
        factors = dict.fromkeys(
            (f"motor.{what}" for what in _TORQUES),
            strength * factor(_TORQUE),
        )
        factors["motor.no_load_speed"] = factor(_SPEED) / math.sqrt(length)
        factors["armature"] = mass * length**2 * factor(_GEAR)
        factors["friction"] = factors["damping"] = mass * length
        for what, larger in factors.items():
            robot = replace_at(robot, f"{name}.{what}", larger * attrgetter(f"{name}.{what}")(base))
    return robot


def _ratios(robot: Robot) -> tuple[float, float]:
    """Return length and mass over those of leg V2."""
    base = _base()
    length = robot.thigh.length + robot.shank.length
    return length / (base.thigh.length + base.shank.length), robot.mass / base.mass


def _unit(unit: str, length: float, mass: float) -> float:
    """Return what a number of a unit is multiplied with on a leg that is so much larger."""
    time, force = math.sqrt(length), mass
    return {
        "N": force,
        "N s/m": force * time / length,
        "N m": force * length,
        "N m/rad": force * length,
        "N m s/rad": force * length * time,
        "kg m2": mass * length**2,
    }.get(unit, 1.0)


def _draw(robot: Robot, ranges: Sequence[Range], rng: np.random.Generator) -> Robot:
    """Return a robot with numbers drawn from ranges of leg V2's size."""
    length, mass = _ratios(robot)
    for spread in ranges:
        own = 0.0 if spread.bounds == "values" else attrgetter(spread.path)(robot)
        value = spread.sample(rng, own) * _unit(spread.unit, length, mass)
        robot = replace_at(robot, spread.path, value)
    return robot


def _fitted(design: Robot, true: Robot, rng: np.random.Generator) -> Robot:
    """Return what a fit would tell of a leg: not quite what it is, links as heavy as designed."""
    told = replace(true, base=design.base) if rng.random() < 0.5 else true
    for spread in (*FRICTION, *INERTIA, *GROUND[:2]):
        error = math.exp(rng.normal(0.0, _FIT_ERROR))
        told = replace_at(told, spread.path, attrgetter(spread.path)(true) * error)
    for link in ("thigh", "shank"):
        told = replace_at(told, f"{link}.mass", getattr(design, link).mass)
    return told
