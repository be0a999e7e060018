"""Makes the environment known to Gymnasium."""

import gymnasium

ENV_ID = "HoppingLeg-v0"
"""Name for ``gymnasium.make`` and ``gymnasium.make_vec``."""


def register_envs() -> None:
    """Register ``HoppingLeg-v0`` once; importing ``hopping_leg.envs`` does it."""
    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            ENV_ID,
            entry_point="hopping_leg.envs.single:HoppingEnv",
            vector_entry_point="hopping_leg.envs.vector:HoppingVectorEnv",
        )
