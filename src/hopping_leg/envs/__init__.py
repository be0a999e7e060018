"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.envs.apex_reward import ApexReward, ApexRewardOptions
from hopping_leg.envs.options import TaskConfig
from hopping_leg.envs.registration import ENV_ID, register_envs
from hopping_leg.envs.reward import PaperReward, PaperRewardOptions
from hopping_leg.envs.single import HoppingEnv
from hopping_leg.envs.step import Step
from hopping_leg.envs.task import HoppingTask
from hopping_leg.envs.transition import Reward, Transition
from hopping_leg.envs.vector import HoppingVectorEnv

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
    "TaskConfig",
    "Transition",
    "register_envs",
]

register_envs()
