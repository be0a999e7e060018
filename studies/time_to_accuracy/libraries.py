"""PPO, SAC and TQC of stable-baselines3 and sbx, with their own default numbers.

sbx is stable-baselines3 in JAX. It is no dependency of the project: ``pip install sbx-rl``.
"""

import importlib
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from torch import nn

from hopping_leg.errors import UsageError
from hopping_leg.rl.foreign import export_policy
from hopping_leg.robot import Robot

ALGORITHMS = {"sb3-ppo": 8, "sb3-sac": 1, "sbx-ppo": 8, "sbx-sac": 1, "sbx-tqc": 1}
"""Number of environments by name: that of the library and of its algorithm."""

Snapshot = tuple[float, int, bytes]  # Seconds, control steps, the policy file as it stood


def learn(name: str, robot: Robot, seed: int, minutes: float, snapshots: int) -> list[Snapshot]:
    """Train for so many CPU minutes on one thread; return policies at equal intervals."""
    torch.set_num_threads(1)
    library, kind = name.split("-")
    try:
        module = importlib.import_module({"sb3": "stable_baselines3"}.get(library, library))
    except ImportError as error:
        raise UsageError(f"{name} needs {library}: pip install sbx-rl.") from error
    began = time.process_time()
    env = make_vec_env(
        "hopping_leg:HoppingLeg-v0", n_envs=ALGORITHMS[name], seed=seed, env_kwargs={"robot": robot}
    )
    model = getattr(module, kind.upper())("MlpPolicy", env, seed=seed, device="cpu")
    model.learn(10**9, callback=(keep := _Keep(began, minutes, snapshots)))
    return keep.snapshots


class _Keep(BaseCallback):  # type: ignore[misc]
    def __init__(self, began: float, minutes: float, snapshots: int) -> None:
        super().__init__()
        self._began, self._every, self._last = began, 60 * minutes / snapshots, 60 * minutes
        self.snapshots: list[Snapshot] = []

    def _on_step(self) -> bool:
        passed = time.process_time() - self._began
        if passed >= self._every * (len(self.snapshots) + 1):
            of_jax = type(self.model).__module__.startswith("sbx")
            trained = torch_actor(self.model) if of_jax else self.model
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "policy.onnx"
                content = export_policy(trained, file, self.model.get_env()).content
            self.snapshots.append((passed, int(self.num_timesteps), content))
        return passed < self._last


def torch_actor(model: Any) -> nn.Sequential:  # noqa: ANN401
    """Return the deterministic actor of an algorithm of sbx."""
    weights, squashed = model.policy.actor_state.params["params"], model.policy.squash_output
    layers: list[nn.Module] = []
    for number in range(len(model.policy.actor.net_arch) + 1):
        dense = weights[f"Dense_{number}"]
        weight, bias = (torch.tensor(np.array(dense[name])) for name in ("kernel", "bias"))
        linear = nn.Linear(*weight.shape)
        linear.load_state_dict({"weight": weight.T, "bias": bias})
        layers += [linear, nn.ReLU() if squashed else nn.Tanh()]
    return nn.Sequential(*layers[:-1], nn.Tanh() if squashed else nn.Identity())
