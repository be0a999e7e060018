"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.rewards import Reward, RewardTerm, Transition, sum_of_joints
from hopping_leg.robot.parameters import Robot

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
    limits = position_limits(robot)
    return Reward(
        (
            RewardTerm("energy", c.energy, partial(energy_gain, rest=rest)),
            RewardTerm("height", -c.height, partial(height_barrier, printed=printed)),
            RewardTerm("jerk", -c.jerk, action_jerk),
            RewardTerm("position", -c.position, partial(joint_position_penalty, limits=limits)),
            RewardTerm(
                "velocity", -c.velocity, partial(joint_velocity_penalty, limit_squared=speed**2)
            ),
        )
    )


def position_limits(robot: Robot) -> Array:
    """Return lower and upper soft limits of hip and knee, rad, (2, 2)."""
    return np.stack([robot.of_joints("lower"), robot.of_joints("upper")])


def energy_gain(t: Transition, rest: float) -> Array:
    """Return Ge: base velocity and height above its rest, m, both squared, m2/s2 + m2."""
    return np.square(t.rate) + np.square(t.height - rest)


def height_barrier(t: Transition, printed: bool) -> Array:
    """Return Ph: grows with the base's height above the desired one, 0 below."""
    excess = t.height - t.command
    growth = np.exp(excess)
    return np.where(excess >= 0, 1 - growth if printed else growth, 0.0)


def action_jerk(t: Transition) -> Array:
    """Return Pj: the squared change of the action."""
    return sum_of_joints(np.square(t.action - t.last_action))


def joint_position_penalty(t: Transition, limits: Array) -> Array:
    """Return Pjp: 1 for each joint beyond its limits, rad, (2, 2), and rising towards it inside."""
    lower, upper = limits[..., None]
    below, above = lower - t.q.T, t.q.T - upper  # (2, n): numpy is slow on rows of two
    near = np.exp(_SHARPNESS * below) + np.exp(_SHARPNESS * above)
    return sum_of_joints(np.where(np.maximum(below, above) > 0, 1.0, near).T)


def joint_velocity_penalty(t: Transition, limit_squared: Array) -> Array:
    """Return Pjv: squared joint velocity less its limit's square, where it is faster, rad2/s2."""
    return sum_of_joints(np.maximum(np.square(t.qd.T) - limit_squared[:, None], 0.0).T)
