"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

from collections.abc import Callable
from dataclasses import dataclass
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
    return Reward(
        (
            RewardTerm("energy", c.energy, energy_gain(c.rest_length + robot.foot.radius)),
            RewardTerm("height", -c.height, height_barrier(c.barrier)),
            RewardTerm("jerk", -c.jerk, action_jerk),
            RewardTerm("position", -c.position, joint_position_penalty(robot)),
            RewardTerm("velocity", -c.velocity, joint_velocity_penalty(speed)),
        )
    )


def energy_gain(rest: float) -> Callable[[Transition], Array]:
    """Return Ge: base velocity and height above its rest, both squared, m2/s2 + m2."""

    def term(t: Transition) -> Array:
        offset, rate = t.height - rest, t.rate
        return rate * rate + offset * offset

    return term


def height_barrier(barrier: Barrier) -> Callable[[Transition], Array | float]:
    """Return Ph: grows with the base's height above the desired one, 0 below."""

    def term(t: Transition) -> Array | float:
        excess = t.height - t.command
        crossed = excess >= 0
        if not np.count_nonzero(crossed):
            return 0.0
        growth = np.exp(excess)
        return (1 - growth if barrier == "printed" else growth) * crossed

    return term


def action_jerk(t: Transition) -> Array:
    """Return Pj: the squared change of the action."""
    change = t.action - t.last_action
    return sum_of_joints(change * change)


def joint_position_penalty(robot: Robot) -> Callable[[Transition], Array]:
    """Return Pjp: 1 for each joint beyond its limits, and rising towards it inside."""
    lower, upper = robot.of_joints("lower"), robot.of_joints("upper")

    def term(t: Transition) -> Array:
        below, above = lower - t.q, t.q - upper
        outside = np.maximum(below, above) > 0
        near = np.exp(_SHARPNESS * below) + np.exp(_SHARPNESS * above)
        if np.count_nonzero(outside):
            near[outside] = 1.0
        return sum_of_joints(near)

    return term


def joint_velocity_penalty(limit: Array) -> Callable[[Transition], Array | float]:
    """Return Pjv: squared joint velocity less its limit's square, where it is faster, rad2/s2."""
    least = np.square(limit)

    def term(t: Transition) -> Array | float:
        over = np.square(t.qd) - least
        if not np.count_nonzero(over > 0):
            return 0.0
        return sum_of_joints(np.maximum(over, 0.0))

    return term
