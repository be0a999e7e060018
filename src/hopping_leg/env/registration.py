"""Makes the environment known to Gymnasium."""

import gymnasium

ENV_ID = "HoppingLeg-v0"
"""Name for ``gymnasium.make`` and ``gymnasium.make_vec``."""


def register_envs() -> None:
    """Register ``HoppingLeg-v0`` once; importing ``hopping_leg.env`` does it."""
    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            ENV_ID,
            entry_point="hopping_leg.env.single:HoppingEnv",
            vector_entry_point="hopping_leg.env.vector:HoppingVectorEnv",
        )
