"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.envs.apex_reward import ApexRewardConfig as ApexRewardConfig
from hopping_leg.envs.apex_reward import apex_reward as apex_reward
from hopping_leg.envs.gymnasium_envs import HoppingEnv as HoppingEnv
from hopping_leg.envs.gymnasium_envs import HoppingVectorEnv as HoppingVectorEnv
from hopping_leg.envs.paper_reward import PaperRewardConfig as PaperRewardConfig
from hopping_leg.envs.paper_reward import paper_reward as paper_reward
from hopping_leg.envs.rewards import LastingTerm as LastingTerm
from hopping_leg.envs.rewards import Reward as Reward
from hopping_leg.envs.rewards import RewardTerm as RewardTerm
from hopping_leg.envs.rewards import Transition as Transition
from hopping_leg.envs.task import HoppingTask as HoppingTask
from hopping_leg.envs.task_config import TaskConfig as TaskConfig
from hopping_leg.sim.any_leg import TaskLeg as TaskLeg
