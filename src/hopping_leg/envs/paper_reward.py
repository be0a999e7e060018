"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.rewards import Reward, RewardTerm, Transition, sum_of_joints
from hopping_leg.robot.parameters import Robot

Barrier = Literal["step", "printed"]

# Arrays of no dimension, and limits in a row: for one leg, numpy takes twice as long for floats of
# Python and for what it has to repeat.
_ZERO, _ONE = np.array(0.0), np.array(1.0)
_SHARPNESS = np.array(10.0)  # steepness of Pjp around the joint limits, 1/rad


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


def paper_reward(robot: Robot, config: PaperRewardConfig = PaperRewardConfig()) -> Reward:
    """Return the paper's reward for a leg, whose joint limits and motors count."""
    c, rest = config, np.array(config.rest_length + robot.foot.radius)
    barrier = partial(height_barrier, printed=c.barrier == "printed")
    speed = robot.of_joints("no_load_speed")[None]
    return Reward(
        (
            RewardTerm("energy", c.energy, partial(energy_gain, rest=rest)),
            RewardTerm("height", -c.height, barrier),
            RewardTerm("jerk", -c.jerk, action_jerk),
            position_term(robot, c.position),
            RewardTerm(
                "velocity", -c.velocity, partial(joint_velocity_penalty, limit_squared=speed**2)
            ),
        )
    )


def position_term(robot: Robot, weight: float) -> RewardTerm:
    """Return the penalty on a robot's joints at their limits."""
    lower, upper = robot.of_joints("lower")[None], robot.of_joints("upper")[None]
    penalty = partial(joint_position_penalty, lower=lower, upper=upper)
    return RewardTerm("position", -weight, penalty)


def energy_gain(t: Transition, rest: Array) -> Array:
    """Return Ge: base velocity and height above its rest, m, both squared, m2/s2 + m2."""
    return np.square(t.rate) + np.square(t.height - rest)


def height_barrier(t: Transition, printed: bool) -> Array:
    """Return Ph: grows with the base's height above the desired one, 0 below."""
    excess = t.height - t.command
    growth = np.exp(excess)
    barrier: Array = np.heaviside(excess, _ONE) * (1 - growth if printed else growth)
    return barrier


def action_jerk(t: Transition) -> Array:
    """Return Pj: the squared change of the action."""
    return sum_of_joints(np.square(t.action - t.last_action))


def joint_position_penalty(t: Transition, lower: Array, upper: Array) -> Array:
    """Return Pjp: 1 for each joint beyond its limits, rad, (1, 2), and rising to it inside."""
    near = np.exp(_SHARPNESS * (lower - t.q)) + np.exp(_SHARPNESS * (t.q - upper))
    return sum_of_joints(np.minimum(near, _ONE))


def joint_velocity_penalty(t: Transition, limit_squared: Array) -> Array:
    """Return Pjv: squared joint velocity less its limit's square, where it is faster, rad2/s2."""
    return sum_of_joints(np.maximum(np.square(t.qd) - limit_squared, _ZERO))
