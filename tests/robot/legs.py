"""Random legs and postures for property tests."""

import dataclasses

import mujoco
import numpy as np
from hypothesis import strategies as st

from hopping_leg.robot import Robot, load_robot

SEEDS = st.integers(0, 2**32 - 1)


def random_robot(rng: np.random.Generator) -> Robot:
    """Return legv2 with every mass, length and inertia drawn anew."""
    robot = load_robot("legv2")
    base = dataclasses.replace(robot.base, mass=rng.uniform(0.2, 5))
    links = {}
    for name in ("thigh", "shank"):
        length = rng.uniform(0.05, 0.6)
        links[name] = dataclasses.replace(
            getattr(robot, name),
            length=length,
            mass=rng.uniform(0.05, 3),
            com=rng.uniform(0.01, 1) * length,
            inertia=10 ** rng.uniform(-4.5, -1),
        )
    joints = {
        name: dataclasses.replace(getattr(robot, name), armature=10 ** rng.uniform(-5, -2))
        for name in ("hip", "knee")
    }
    return dataclasses.replace(robot, base=base, **links, **joints)


def random_state(rng: np.random.Generator, count: int = 1):
    """Return (height, height rate, q, qd) of ``count`` legs anywhere above the ground."""
    height = rng.uniform(2, 3, count)
    return (
        height,
        rng.normal(0, 3, count),
        rng.uniform(-3, 3, (count, 2)),
        rng.normal(0, 10, (count, 2)),
    )


def posed(model, height, rate, q, qd):
    """Return the data of a MuJoCo model in the first of some states."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = [height[0], *q[0]], [rate[0], *qd[0]]
    mujoco.mj_forward(model, data)
    return data
