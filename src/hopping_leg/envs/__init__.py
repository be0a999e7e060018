"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.envs.apex_reward import ApexRewardConfig, apex_reward
from hopping_leg.envs.gymnasium_envs import HoppingEnv, HoppingVectorEnv
from hopping_leg.envs.paper_reward import PaperRewardConfig, paper_reward
from hopping_leg.envs.rewards import LastingTerm, Reward, RewardTerm, Transition
from hopping_leg.envs.task import HoppingTask, TaskLeg
from hopping_leg.envs.task_config import TaskConfig

__all__ = [
    "ApexRewardConfig",
    "HoppingEnv",
    "HoppingTask",
    "HoppingVectorEnv",
    "LastingTerm",
    "PaperRewardConfig",
    "Reward",
    "RewardTerm",
    "TaskConfig",
    "TaskLeg",
    "Transition",
    "apex_reward",
    "paper_reward",
]
