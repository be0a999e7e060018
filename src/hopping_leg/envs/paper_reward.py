"""The paper's reward (Sec. II-C, "Reward"): R = w1 Ge - w2 Ph - w3 Pj - w4 Pjp - w5 Pjv."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs.initial_states import standing_length
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


def paper_reward(robot: Robot, config: PaperRewardConfig = PaperRewardConfig()) -> Reward:
    """Return the paper's reward for a leg; x_o is the base's height where it stands at first."""
    c, rest = config, np.array(standing_length(robot) + robot.foot.radius)
    fastest = np.square(robot.of_joints("no_load_speed")[None])
    lower, upper = robot.of_joints("lower")[None], robot.of_joints("upper")[None]

    def energy_gain(t: Transition) -> Array:  # Ge, m2/s2 + m2
        gain: Array = np.square(t.rate) + np.square(t.height - rest)
        return gain

    def height_barrier(t: Transition) -> Array:  # Ph: 0 below the desired height
        excess = t.height - t.command
        growth = np.exp(excess)
        growth = 1 - growth if c.barrier == "printed" else growth
        barrier: Array = np.heaviside(excess, _ONE) * growth
        return barrier

    def joint_position_penalty(t: Transition) -> Array:  # Pjp: 1 beyond limits, rising to it
        near = np.exp(_SHARPNESS * (lower - t.q)) + np.exp(_SHARPNESS * (t.q - upper))
        return sum_of_joints(np.minimum(near, _ONE))

    def joint_velocity_penalty(t: Transition) -> Array:  # Pjv, where a joint is faster, rad2/s2
        return sum_of_joints(np.maximum(np.square(t.qd) - fastest, _ZERO))

    return Reward(
        (
            RewardTerm("energy", c.energy, energy_gain),
            RewardTerm("height", -c.height, height_barrier),
            jerk_term(c.jerk),
            RewardTerm("position", -c.position, joint_position_penalty),
            RewardTerm("velocity", -c.velocity, joint_velocity_penalty),
        )
    )


def jerk_term(weight: float) -> RewardTerm:
    """Return Pj, the penalty on the squared change of the action."""
    return RewardTerm("jerk", -weight, lambda t: sum_of_joints(np.square(t.action - t.last_action)))
