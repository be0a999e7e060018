"""Small recipes that train in a second."""

import torch
from stable_baselines3.common.logger import configure

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.rl.onnx_export import build_policy
from hopping_leg.rl.recipe import Recipe
from hopping_leg.rl.recipes.adaptive import ADAPTIVE
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.recipes.paper import PAPER
from hopping_leg.rl.recipes.precise import GRU, LEARNT, PRECISE
from hopping_leg.rl.resumable import ResumablePPO
from hopping_leg.robot import load_robot
from hopping_leg.sim.randomization import WIDE_RANGES

ROBOT = load_robot("legv2-paper")
TINY = PAPER.replace(
    steps=1200, learning_starts=300, eval_every=10**9, actor=(8, 8), critic=(8, 8), num_envs=2,
    gradient_steps=4, batch_size=16,
)  # fmt: skip
SMALL = {
    "steps": 768, "num_envs": 4, "n_steps": 32, "batch_size": 64, "actor": (8, 8), "critic": (8, 8),
}  # fmt: skip
STUDENT = {
    "student.hidden": (8, 8), "student.error_hidden": (8, 8), "student.size": 8,
    "teacher_share": 0.4, "dagger.buffer_size": 200, "dagger.gradient_steps": 4,
    "dagger.batch_size": 64,
}  # fmt: skip
TINY_FAST = FAST.replace(SMALL)
TINY_LEARNT = LEARNT.replace(SMALL | STUDENT, eval_commands=(0.3,), teachers=3)
TINY_GRU = LEARNT.replace(GRU | SMALL | STUDENT | {"dagger.buffer_size": 400})
TINY_PRECISE = PRECISE.replace(SMALL | STUDENT)
TINY_ADAPTIVE = ADAPTIVE.replace(SMALL | STUDENT)


class TinyPPO(Recipe):
    def make_model(self, env, seed):
        return ResumablePPO(
            "MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=2, use_sde=True, seed=seed,
            learning_rate=lambda left: 1e-3 * left, policy_kwargs={"net_arch": [8]}, device="cpu",
        )  # fmt: skip


TINY_PPO = TinyPPO(**vars(PAPER.replace(steps=640, privileged_critic=False, num_envs=2)))
EVERY = {
    "sac": TINY, "ppo": TINY_PPO, "fast": TINY_FAST, "learnt": TINY_LEARNT,
    "recurrent": TINY_GRU, "adaptive": TINY_ADAPTIVE,
    "precise": TINY_PRECISE,
    "surprised": TINY_LEARNT.replace({"task.randomised": WIDE_RANGES}),
}  # fmt: skip


def learner(recipe, seed=3):
    torch.set_num_threads(1)
    env = recipe.make_env(ROBOT, seed)
    model = recipe.make_model(env, seed)
    model.set_logger(configure(None, []))
    return model


def policy_file(recipe, model):
    """Return the policy that a recipe exports of a model."""
    task = recipe.task
    about = task.observation, *task.command_bounds, task.action_torque
    card = Card("test", *about, ROBOT.name, ROBOT.digest, task.rate)
    return Policy(build_policy(recipe.actor(model, model.env), card), "memory", "test")
