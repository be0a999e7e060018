"""stable-baselines3's PPO and SAC on the Gymnasium environment, with their own defaults."""

import tempfile
import time
from pathlib import Path

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from hopping_leg.rl.foreign import export_policy
from hopping_leg.robot import Robot

ALGORITHMS = {"sb3-ppo": (PPO, 8), "sb3-sac": (SAC, 1)}
"""Algorithm and number of environments by name."""


Snapshot = tuple[float, int, bytes]
"""Seconds, control steps and the policy file as it stood."""


def learn(name: str, robot: Robot, seed: int, minutes: float, snapshots: int) -> list[Snapshot]:
    """Train for so many minutes on two threads; return policies at equal intervals."""
    torch.set_num_threads(2)
    algorithm, count = ALGORITHMS[name]
    began = time.monotonic()
    env = make_vec_env(
        "hopping_leg:HoppingLeg-v0", n_envs=count, seed=seed, env_kwargs={"robot": robot}
    )
    model = algorithm("MlpPolicy", env, seed=seed, device="cpu")
    keep = _Keep(began, minutes, snapshots)
    model.learn(10**9, callback=keep)
    return keep.snapshots


class _Keep(BaseCallback):  # type: ignore[misc]
    def __init__(self, began: float, minutes: float, snapshots: int) -> None:
        super().__init__()
        self._began, self._every, self._last = began, 60 * minutes / snapshots, 60 * minutes
        self.snapshots: list[Snapshot] = []

    def _on_step(self) -> bool:
        passed = time.monotonic() - self._began
        if passed >= self._every * (len(self.snapshots) + 1):
            with tempfile.TemporaryDirectory() as folder:
                content = export_policy(self.model, Path(folder) / "policy.onnx").content
            self.snapshots.append((passed, int(self.num_timesteps), content))
        return passed < self._last
