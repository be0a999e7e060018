"""The precise recipe: one network from 0.7 s of joint samples to torques.

A student learns by imitation of `mpc-true-state`, which sees the true state and plans every
push, so that nothing has to be found by trial and error. Longer, wider and on more of the past than
``fast``.
"""

from hopping_leg.controllers.mpc import Planning
from hopping_leg.rl import recipe
from hopping_leg.rl.distillation.dagger import DaggerConfig
from hopping_leg.rl.distillation.students import StudentConfig
from hopping_leg.rl.recipes.fast import FAST

PRECISE = recipe.Recipe(
    name="precise",
    task=FAST.task,
    algorithm=DaggerConfig(planning=Planning(elastic_timestep=5e-4)),
    network=StudentConfig(),
    schedule=recipe.Schedule(num_envs=256, steps=4_000_000, log_every=16),
    selection=FAST.selection,
)
