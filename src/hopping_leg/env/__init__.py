"""The learning problem: observation, reward, reset, as a Gymnasium env and vector env."""

from hopping_leg.env.options import TaskOptions
from hopping_leg.env.reward import PaperReward, PaperRewardOptions
from hopping_leg.env.task import HoppingTask, Step
from hopping_leg.env.transition import Reward, Transition

__all__ = [
    "HoppingTask",
    "PaperReward",
    "PaperRewardOptions",
    "Reward",
    "Step",
    "TaskOptions",
    "Transition",
]
