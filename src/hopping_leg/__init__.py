"""End-to-end reinforcement learning for torque-based, variable-height hopping of one leg.

Importing it makes ``HoppingLeg-v0`` known to Gymnasium, and so does the name
``hopping_leg:HoppingLeg-v0``.
"""

import importlib
from typing import Any

from gymnasium.envs.registration import register

ENV_ID = "HoppingLeg-v0"
"""Name for ``gymnasium.make`` and ``gymnasium.make_vec``."""

register(
    ENV_ID,
    entry_point="hopping_leg.envs.gymnasium_envs:HoppingEnv",
    vector_entry_point="hopping_leg.envs.gymnasium_envs:HoppingVectorEnv",
)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import ``export_policy``, which needs torch, where it is asked for."""
    if name != "export_policy":
        raise AttributeError(f"module 'hopping_leg' has no attribute '{name}'")
    return importlib.import_module("hopping_leg.rl.foreign").export_policy
