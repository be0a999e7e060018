"""End-to-end reinforcement learning for torque-based, variable-height hopping of one leg.

Importing it makes ``HoppingLeg-v0`` known to Gymnasium, and so does the name
``hopping_leg:HoppingLeg-v0``.
"""

from gymnasium.envs.registration import register

ENV_ID = "HoppingLeg-v0"
"""Name for ``gymnasium.make`` and ``gymnasium.make_vec``."""

register(
    ENV_ID,
    entry_point="hopping_leg.envs.gymnasium_envs:HoppingEnv",
    vector_entry_point="hopping_leg.envs.gymnasium_envs:HoppingVectorEnv",
)
