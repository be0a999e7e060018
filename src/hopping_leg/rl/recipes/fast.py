"""The fast recipe: accurate hopping soon, by imitation of `mpc-true-state`.

Rollouts are short and gradient steps many: a student has to meet the states in which it stands
still soon.
"""

from hopping_leg.controllers.mpc import Planning
from hopping_leg.envs import TaskConfig
from hopping_leg.rl import recipe
from hopping_leg.rl.dagger import DaggerConfig
from hopping_leg.rl.students import StudentConfig

COARSE = Planning(timestep=1.25e-3, elastic_timestep=5e-4, simulations=3, tolerance=3e-4, every=2)
"""Plans that labels need no finer."""

FAST = recipe.Recipe(
    name="fast",
    task=TaskConfig(
        observation="dated-long",
        action_torque=(8.0, 18.0),
        command_range=(0.21, 0.45),
        command_resampling_time=(1.0, 5.0),
        reset_distribution="hop",
        episode=8.0,
        random_episode_start=True,
    ),
    algorithm=DaggerConfig(
        learning_rate=3e-3, n_steps=32, gradient_steps=32, batch_size=1024, planning=COARSE
    ),
    network=StudentConfig(hidden=(128, 64)),
    schedule=recipe.Schedule(num_envs=256, steps=300_000, log_every=8),
    selection=recipe.SelectionConfig(
        eval_every=10**9, eval_commands=(0.22, 0.26, 0.30, 0.34, 0.38, 0.42), calibrations=2
    ),
)
