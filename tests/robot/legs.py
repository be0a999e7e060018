"""Random legs and postures for property tests."""

import mujoco
import numpy as np
from hypothesis import strategies as st

from hopping_leg.io import replace_at
from hopping_leg.robot import JOINTS, Robot, load_robot

SEEDS = st.integers(0, 2**32 - 1)


def random_robot(rng: np.random.Generator) -> Robot:
    """Return legv2 with every mass, length and inertia drawn anew."""
    numbers = {"base.mass": rng.uniform(0.2, 5)}
    for link in ("thigh", "shank"):
        length = numbers[f"{link}.length"] = rng.uniform(0.05, 0.6)
        numbers[f"{link}.mass"] = rng.uniform(0.05, 3)
        numbers[f"{link}.com"] = rng.uniform(0.01, 1) * length
        numbers[f"{link}.inertia"] = 10 ** rng.uniform(-4.5, -1)
    numbers |= {f"{joint}.armature": 10 ** rng.uniform(-5, -2) for joint in JOINTS}
    robot = load_robot("legv2")
    for path, number in numbers.items():
        robot = replace_at(robot, path, number)
    return robot


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
