"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.rewards import PerLeg, Reward, RewardTerm
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.compiled import compiled

Barrier = Literal["step", "printed"]

_SHARPNESS = 10.0  # steepness of Pjp around the joint limits, 1/rad


@dataclass(frozen=True)
class PaperRewardConfig:
    """Weights as printed, and the readings of what the paper leaves open."""

    energy: float = 0.5
    """w1, weight of the energy gain Ge."""
    height: float = 2.0
    """w2, weight of the height barrier Ph."""
    jerk: float = 0.05
    """w3, weight of the jerky action penalty Pj."""
    position: float = 0.02
    """w4, weight of the joint position penalty Pjp."""
    velocity: float = 0.005
    """w5, weight of the joint velocity penalty Pjv."""
    barrier: Barrier = "step"
    """Ph above the desired height: e^(x - xd), or as printed 1 - e^(x - xd)."""
    rest_length: float = 0.2
    """Leg length of the initial standing position, m; x_o is the base height standing on it."""
    velocity_limit: float | None = None
    """Largest desired joint velocity, rad/s; none takes the motors' no-load speed at each joint."""


def paper_reward(robot: Robot, config: PaperRewardConfig = PaperRewardConfig()) -> Reward:
    """Return the paper's reward for a leg, whose joint limits and motors count."""
    c, limit = config, config.velocity_limit
    speed = robot.of_joints("no_load_speed") if limit is None else np.full(2, limit)
    rest, printed = c.rest_length + robot.foot.radius, c.barrier == "printed"
    return Reward(
        (
            RewardTerm("energy", c.energy, PerLeg(energy_gain, rest)),
            RewardTerm("height", -c.height, PerLeg(height_barrier, printed)),
            RewardTerm("jerk", -c.jerk, PerLeg(action_jerk)),
            RewardTerm(
                "position", -c.position, PerLeg(joint_position_penalty, position_limits(robot))
            ),
            RewardTerm("velocity", -c.velocity, PerLeg(joint_velocity_penalty, speed)),
        )
    )


def position_limits(robot: Robot) -> Array:
    """Return lower and upper soft limits of hip and knee, rad, (2, 2)."""
    return np.stack([robot.of_joints("lower"), robot.of_joints("upper")])


@compiled
def energy_gain(
    state: Array, command: Array, action: Array, last: Array, rest: float, terms: Array, column: int
) -> None:
    """Set Ge: base velocity and height above its rest, both squared, m2/s2 + m2."""
    for leg in range(len(terms)):
        offset, rate = state[leg, 0] - rest, state[leg, 3]
        terms[leg, column] = rate * rate + offset * offset


@compiled
def height_barrier(
    state: Array,
    command: Array,
    action: Array,
    last: Array,
    printed: bool,
    terms: Array,
    column: int,
) -> None:
    """Set Ph: grows with the base's height above the desired one, 0 below."""
    for leg in range(len(terms)):
        excess = state[leg, 0] - command[leg]
        growth = math.exp(excess) if excess >= 0 else 0.0
        terms[leg, column] = 1 - growth if printed and excess >= 0 else growth


@compiled
def action_jerk(
    state: Array, command: Array, action: Array, last: Array, terms: Array, column: int
) -> None:
    """Set Pj: the squared change of the action."""
    for leg in range(len(terms)):
        hip, knee = action[leg, 0] - last[leg, 0], action[leg, 1] - last[leg, 1]
        terms[leg, column] = hip * hip + knee * knee


@compiled
def joint_position_penalty(
    state: Array,
    command: Array,
    action: Array,
    last: Array,
    limits: Array,
    terms: Array,
    column: int,
) -> None:
    """Set Pjp: 1 for each joint beyond its limits, rad, (2, 2), and rising towards it inside."""
    for leg in range(len(terms)):
        terms[leg, column] = 0.0
        for joint in range(2):
            q = state[leg, 1 + joint]
            below, above = limits[0, joint] - q, q - limits[1, joint]
            near = math.exp(_SHARPNESS * below) + math.exp(_SHARPNESS * above)
            terms[leg, column] += 1.0 if max(below, above) > 0 else near


@compiled
def joint_velocity_penalty(
    state: Array,
    command: Array,
    action: Array,
    last: Array,
    limit: Array,
    terms: Array,
    column: int,
) -> None:
    """Set Pjv: squared joint velocity less its limit's square, where it is faster, rad2/s2."""
    for leg in range(len(terms)):
        terms[leg, column] = 0.0
        for joint in range(2):
            qd = state[leg, 4 + joint]
            terms[leg, column] += max(qd * qd - limit[joint] * limit[joint], 0.0)
