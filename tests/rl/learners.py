"""Small recipes that train in a second."""

from dataclasses import replace

import torch
from stable_baselines3.common.logger import configure

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.rl import policy_evaluation
from hopping_leg.rl.onnx_export import build_policy
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.recipes.paper import PAPER
from hopping_leg.rl.recipes.rl import RL
from hopping_leg.rl.recipes.universal import UNIVERSAL
from hopping_leg.robot import COARSE_TIMESTEP, DEFAULT_ROBOT, load_robot
from hopping_leg.sim.any_leg import draw_any_leg
from hopping_leg.sim.randomization import WIDE_RANGES

ROBOT = load_robot(DEFAULT_ROBOT)
TINY = PAPER.replace(
    steps=1200, learning_starts=300, eval_every=10**9, actor=(8, 8), critic=(8, 8), num_envs=2,
    gradient_steps=4, batch_size=16,
)  # fmt: skip
TINY_FAST = FAST.replace(
    {"task.timestep": COARSE_TIMESTEP, "task.observation": "dated"},
    num_envs=4, steps=768, n_steps=16, buffer_size=320, gradient_steps=4, batch_size=64,
    hidden=(8, 8), size=8, mixing_share=0.4, calibrations=1, heights=(0.28, 0.32),
    eval_commands=(0.28, 0.32),
)  # fmt: skip
STUDENTS = {
    "window": TINY_FAST,
    "gru": TINY_FAST.replace(memory="gru"),
    "surprised": TINY_FAST.replace({"task.randomised": WIDE_RANGES}),
}
TINY_RL = RL.replace(
    {"task.timestep": COARSE_TIMESTEP},
    num_envs=4, steps=768, n_steps=16, batch_size=32, actor=(8, 8), critic=(8, 8), calibrations=1,
    heights=(0.28, 0.32), eval_commands=(0.28, 0.32),
)  # fmt: skip
EVERY = {"sac": TINY, "ppo": TINY_RL.replace(workers=2), **STUDENTS}
TINY_UNIVERSAL = UNIVERSAL.replace(
    num_envs=4, steps=2048, n_steps=32, buffer_size=512, gradient_steps=4, batch_size=64,
    hidden=(8,), size=8, mixing_share=0.4, eval_commands=(0.28, 0.32),
)  # fmt: skip


def some_legs(count=4):
    """Return drawn legs that are asked for what about any of them reaches."""
    drawn = map(draw_any_leg, range(count))
    return [replace(leg, command_range=(0.9 * (h := leg.true.straight_height), h)) for leg in drawn]


def learner(recipe, seed=3, robot=ROBOT):
    torch.set_num_threads(1)
    legs = some_legs(recipe.schedule.num_envs) if recipe.legs == "any" else ()
    made = recipe.make_learner(robot, seed, legs=legs)
    made.set_logger(configure(None, []))
    return made


def learn(made, steps):
    made.train_until(steps, lambda: True, 10**9)
    return made


def policy_file(recipe, made):
    """Return the policy that a learner exports."""
    task = recipe.task
    about = task.observation, *task.command_bounds, task.action_torque
    card = Card("test", *about, ROBOT.name, ROBOT.digest, task.rate)
    policy = Policy(build_policy(made.network(), made.task.observation, card), "memory", "test")
    policy.set_robot(ROBOT)
    return policy


def try_briefly(monkeypatch):
    """Let trials of policies take half a second."""
    monkeypatch.setitem(policy_evaluation.evaluate_policy.__kwdefaults__, "seconds", 0.5)
    monkeypatch.setattr(policy_evaluation, "_RANGE_SECONDS", 0.5)
