"""Small recipes that train in a second."""

import dataclasses

import torch
from hopping_leg.rl.recipes.recurrent import RecurrentRecipe
from stable_baselines3.common.logger import configure

from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.rl.recipes.adaptive import AdaptiveRecipe
from hopping_leg.rl.recipes.fast import FastRecipe
from hopping_leg.rl.recipes.paper import PaperRecipe
from hopping_leg.rl.recipes.precise import PreciseRecipe
from hopping_leg.rl.resumable import ResumablePPO
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")
TINY = PaperRecipe(
    steps=1200,
    learning_starts=300,
    eval_every=10**9,
    hidden=(8, 8),
    num_envs=2,
    gradient_steps=4,
    batch_size=16,
)
TINY_FAST = FastRecipe(
    steps=768, num_envs=4, n_steps=32, batch_size=64, actor=(8, 8), critic=(8, 8)
)
TINY_PRECISE = PreciseRecipe(
    eval_commands=(0.3,), teachers=3, exam_at=(1.0,),
    steps=768, num_envs=4, n_steps=32, batch_size=64, actor=(8, 8), critic=(8, 8), student=(8, 8),
    teacher_share=0.4, dagger=DaggerConfig(buffer_size=200, gradient_steps=4, batch_size=64),
)  # fmt: skip


TINY_RECURRENT = RecurrentRecipe(
    steps=768, num_envs=4, n_steps=32, batch_size=64, actor=(8, 8), critic=(8, 8), memory=8,
    teacher_share=0.4, dagger=DaggerConfig(buffer_size=200, gradient_steps=4, batch_size=64),
)  # fmt: skip


TINY_ADAPTIVE = AdaptiveRecipe(
    steps=768, num_envs=4, n_steps=32, batch_size=64, actor=(8, 8), critic=(8, 8), student=(8, 8),
    feeling=(8, 8), teacher_share=0.4,
    dagger=DaggerConfig(buffer_size=200, gradient_steps=4, batch_size=64),
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class TinyPPO(PaperRecipe):
    name = "ppo"
    steps: int = 640
    privileged_critic: bool = False
    num_envs: int = 2

    def make_model(self, env, seed):
        return ResumablePPO(
            "MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=2, use_sde=True, seed=seed,
            learning_rate=lambda left: 1e-3 * left, policy_kwargs={"net_arch": [8]}, device="cpu",
        )  # fmt: skip


def learner(recipe, seed=3):
    torch.set_num_threads(1)
    env = recipe.make_env(ROBOT, seed)
    model = recipe.make_model(env, seed)
    model.set_logger(configure(None, []))
    return model
