"""Legs for tests of simulators, and how they are shaken."""

import dataclasses

import numpy as np

from hopping_leg.io import replace_at
from hopping_leg.robot import GRAVITY, DriveMismatch, dynamics, load_robot
from hopping_leg.robot.model_mismatch import ModelMismatch
from hopping_leg.sim import LegSimulator

POSTURE = np.array([0.7, -1.4])

STEP = 5e-4  # Physics step of these tests, s, unless they are about it


def make_legs(robot, count=1, **options):
    """Return legs on one thread at the physics step of these tests."""
    return LegSimulator(robot, count, **{"threads": 1, "timestep": STEP} | options)


def with_reality(robot=None, **parts):
    """Return a robot, legv2 unless given, with some effects of ``[reality]``."""
    return dataclasses.replace(robot or load_robot("legv2"), reality=ModelMismatch(**parts))


def both(**numbers):
    """Return the same effects for hip and knee."""
    return {"hip": DriveMismatch(**numbers), "knee": DriveMismatch(**numbers)}


def without_friction(robot):
    """Return a robot whose rail and joints have neither friction nor damping."""
    none = {"friction": 0.0, "damping": 0.0}
    return with_joints(robot, rail=none, **none)


def with_joints(robot, rail=None, **changes):
    """Return a robot with numbers of both joints, and of the rail, changed."""
    parts = {name: dataclasses.replace(getattr(robot, name), **changes) for name in ("hip", "knee")}
    return dataclasses.replace(robot, rail=dataclasses.replace(robot.rail, **(rail or {})), **parts)


def with_strong_motors(robot):
    """Return a robot whose motors give what they are asked for at any speed."""
    for joint in ("hip", "knee"):
        for name, strong in (("peak_torque", 1e6), ("no_load_speed", 1e9)):
            robot = replace_at(robot, f"{joint}.motor.{name}", strong)
    return robot


def hanging(robot, count=1, q=(0.0, 0.0), **options):
    """Return legs with a fixed base."""
    legs = make_legs(robot, count, fixed_base=True, **options)
    legs.place(slice(None), 1.0, np.asarray(q, float))
    return legs


def energy(legs):
    """Return the energy of each leg, J, (n,), with that of rotors on springs."""
    robot, reality, rotors = legs.robot, legs.robot.reality, 0.0
    if reality.hip.stiffness is not None:
        robot = with_joints(robot, armature=0.0)
        armature = legs.robot.of_joints("armature")
        beyond = np.abs(legs.measured_q - legs.q) - reality.of_drives("backlash") / 2
        spring = reality.of_drives("stiffness") * np.maximum(beyond, 0) ** 2
        rotors = (spring + armature * legs.measured_qd**2).sum(axis=1) / 2
    speed, (thigh, shank) = legs.state[:, 3:], (robot.thigh, robot.shank)
    moments = thigh.mass * thigh.com + shank.mass * thigh.length, shank.mass * shank.com
    potential = robot.mass * legs.height - np.cos(np.cumsum(legs.q, axis=1)) @ moments
    mass = dynamics.mass_matrix(robot, legs.q)
    return np.einsum("ni,nij,nj->n", speed, mass, speed) / 2 + GRAVITY * potential + rotors


def states(legs, ticks=60):
    """Return the states of legs that push off and land, (ticks, n, 6)."""
    legs.stand(slice(None), POSTURE, 0.05)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(ticks):
        legs.step(np.tile(rng.uniform(-4, 4, 2), (legs.count, 1)))
        found.append(legs.state.copy())
    return np.stack(found)
