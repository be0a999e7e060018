"""The rl recipe: from joints to torques by trial and error alone, in minutes.

No teacher, no height estimate, no state machine: proximal policy optimisation is paid for apexes
near the command. Its critic sees the true state; its actor sees dated joint samples of the last ten
control periods and its own torques.
"""

from dataclasses import replace

from hopping_leg.envs import ApexRewardConfig
from hopping_leg.rl import ppo, recipe
from hopping_leg.rl.learner import NetworkConfig
from hopping_leg.rl.recipes.fast import FAST

RL = recipe.Recipe(
    name="rl",
    task=replace(FAST.task, observation="dated", command_range=(0.21, 0.41), timestep=2.5e-4),
    reward=ApexRewardConfig(
        width=(0.030, 0.006),
        energy=0.8,
        energy_beyond=0.05,
        jerk=0.7,
        effort=0.2,
        reversals=2.0,
        limits=(3.0, 20.0),
    ),
    algorithm=ppo.PPOConfig(),
    network=NetworkConfig(actor=(64, 64), critic=(64, 64)),
    schedule=recipe.Schedule(num_envs=1024, steps=8_000_000, log_every=8),
    selection=recipe.SelectionConfig(
        eval_every=10**9, eval_commands=(0.22, 0.26, 0.30, 0.34, 0.38), calibrations=3
    ),
)
