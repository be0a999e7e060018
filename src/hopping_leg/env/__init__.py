"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.env.apex_reward import ApexReward, ApexRewardOptions
from hopping_leg.env.options import TaskOptions
from hopping_leg.env.registration import ENV_ID, register_envs
from hopping_leg.env.reward import PaperReward, PaperRewardOptions
from hopping_leg.env.single import HoppingEnv
from hopping_leg.env.step import Step
from hopping_leg.env.task import HoppingTask
from hopping_leg.env.transition import Reward, Transition
from hopping_leg.env.vector import HoppingVectorEnv

__all__ = [
    "ENV_ID",
    "ApexReward",
    "ApexRewardOptions",
    "HoppingEnv",
    "HoppingTask",
    "HoppingVectorEnv",
    "PaperReward",
    "PaperRewardOptions",
    "Reward",
    "Step",
    "TaskOptions",
    "Transition",
    "register_envs",
]

register_envs()
