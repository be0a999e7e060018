"""stable-baselines3's PPO and SAC on the Gymnasium environment, with their own defaults."""

import time
from dataclasses import dataclass

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from hopping_leg.controllers.policy import Card
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import make_observation
from hopping_leg.rl.onnx_export import DenseActor, build_policy
from hopping_leg.robot import Robot

ALGORITHMS = {"sb3-ppo": (PPO, 8), "sb3-sac": (SAC, 1)}
"""Algorithm and number of environments by name."""


@dataclass(frozen=True)
class Snapshot:
    """A policy as it stood."""

    seconds: float
    steps: int
    content: bytes


def learn(name: str, robot: Robot, seed: int, minutes: float, snapshots: int) -> list[Snapshot]:
    """Train for so many minutes on two threads; return policies at equal intervals."""
    torch.set_num_threads(2)
    algorithm, count = ALGORITHMS[name]
    began = time.monotonic()
    env = make_vec_env(
        "hopping_leg:HoppingLeg-v0", n_envs=count, seed=seed, env_kwargs={"robot": robot}
    )
    model = algorithm("MlpPolicy", env, seed=seed, device="cpu")
    keep = _Keep(name, robot, seed, began, minutes, snapshots)
    model.learn(10**9, callback=keep)
    return keep.snapshots


class _Keep(BaseCallback):  # type: ignore[misc]
    def __init__(
        self, name: str, robot: Robot, seed: int, began: float, minutes: float, snapshots: int
    ) -> None:
        super().__init__()
        self._name, self._robot, self._seed = name, robot, seed
        self._began, self._every, self._last = began, 60 * minutes / snapshots, 60 * minutes
        self.snapshots: list[Snapshot] = []

    def _on_step(self) -> bool:
        passed = time.monotonic() - self._began
        if passed >= self._every * (len(self.snapshots) + 1):
            content = policy_file(self.model, self._name, self._robot, self._seed)
            self.snapshots.append(Snapshot(passed, int(self.num_timesteps), content))
        return passed < self._last


def policy_file(model: BaseAlgorithm, name: str, robot: Robot, seed: int) -> bytes:
    """Return the policy file of a model trained on the environment's own defaults."""
    task = TaskConfig()
    if isinstance(model, SAC):
        actor = DenseActor(model.actor.latent_pi, model.actor.mu, torch.nn.Tanh())
    else:
        actor = DenseActor(model.policy.mlp_extractor.policy_net, model.policy.action_net)
    low, high = task.command_bounds
    card = Card(
        name, task.observation, low, high, task.action_torque, robot.name, robot.digest, task.rate,
        seed=seed, steps=int(model.num_timesteps),
    )  # fmt: skip
    return build_policy(actor, make_observation(robot, task, 1), card)
