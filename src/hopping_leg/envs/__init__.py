"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.envs.apex_reward import ApexRewardConfig, apex_reward
from hopping_leg.envs.options import TaskConfig
from hopping_leg.envs.paper_reward import PaperRewardConfig, paper_reward
from hopping_leg.envs.registration import ENV_ID, register_envs
from hopping_leg.envs.rewards import Reward, RewardTerm, Transition
from hopping_leg.envs.single import HoppingEnv
from hopping_leg.envs.step import Step
from hopping_leg.envs.task import HoppingTask
from hopping_leg.envs.vector import HoppingVectorEnv

__all__ = [
    "ENV_ID",
    "ApexRewardConfig",
    "HoppingEnv",
    "HoppingTask",
    "HoppingVectorEnv",
    "PaperRewardConfig",
    "Reward",
    "RewardTerm",
    "Step",
    "TaskConfig",
    "Transition",
    "apex_reward",
    "paper_reward",
    "register_envs",
]

register_envs()
