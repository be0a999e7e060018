"""Legs for tests of simulators, and how they are shaken."""

import dataclasses

import numpy as np

from hopping_leg.robot import ModelMismatch, load_robot
from hopping_leg.robot.dynamics import kinetic_energy, potential_energy
from hopping_leg.sim import MujocoSimulator

POSTURE = np.array([0.7, -1.4])


def with_reality(robot=None, **parts):
    """Return a robot, legv2 unless given, with some effects of ``[reality]``."""
    return dataclasses.replace(robot or load_robot("legv2"), reality=ModelMismatch(**parts))


def without_friction(robot, *, damping=False):
    """Return a robot whose rail and joints have no Coulomb friction, and damping only if asked."""
    none = {"friction": 0.0} if damping else {"friction": 0.0, "damping": 0.0}
    parts = ("rail", "hip", "knee")
    changed = {name: dataclasses.replace(getattr(robot, name), **none) for name in parts}
    return dataclasses.replace(robot, **changed)


def energy(legs):
    """Return the mechanical energy of each leg, J, (n,)."""
    kinetic = kinetic_energy(legs.robot, legs.q, legs.height_rate, legs.qd)
    return kinetic + potential_energy(legs.robot, legs.height, legs.q)


def states(legs, ticks=60):
    """Return the states of legs that push off and land, (ticks, n, 6)."""
    legs.stand(slice(None), POSTURE, 0.05)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(ticks):
        legs.step(np.tile(rng.uniform(-4, 4, 2), (legs.count, 1)))
        found.append(legs.state.copy())
    return np.stack(found)


def assert_as_alone(legs, robots):
    """Check that each leg moves as a lone one of its robot does, to the bit."""
    together = states(legs)
    for index, robot in enumerate(robots):
        alone = states(MujocoSimulator(robot, 1, threads=1))
        np.testing.assert_array_equal(together[:, index], alone[:, 0])
    return together
