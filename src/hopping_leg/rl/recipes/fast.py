"""The fast recipe: accurate hopping in minutes on two cores.

PPO on many legs at once. What makes it fast, largest lever first: state-dependent exploration
(gSDE), a critic that sees the true state, a reward at the apex itself, joint samples that say when
they were taken, episodes that begin on the hop they should end in.
"""

from hopping_leg.envs import ApexRewardConfig, TaskConfig
from hopping_leg.rl import algorithms, recipe
from hopping_leg.rl.search_space import LAYERS, OneOf, Real, SearchSpace

FAST = recipe.Recipe(
    name="fast",
    task=TaskConfig(
        observation="dated",
        command_range=(0.22, 0.40),
        command_resampling_time=(1.0, 5.0),
        reset_distribution="hop",
        random_episode_start=True,
        timestep=1e-3,
    ),
    reward=ApexRewardConfig(),
    algorithm=algorithms.PPOConfig(),
    network=algorithms.NetworkConfig(actor=(128, 64), critic=(256, 128)),
    schedule=recipe.Schedule(num_envs=512, steps=6_000_000, log_every=4),
    selection=recipe.SelectionConfig(eval_every=600_000),
)

SEARCH_SPACE: SearchSpace = {
    "learning_rate": Real(2e-4, 4e-3, log=True),
    "actor": OneOf(LAYERS),
    "critic": OneOf(LAYERS),
    "gamma": Real(0.97, 0.997),
    "gae_lambda": Real(0.90, 0.99),
    "sde_sample_freq": OneOf((0, 8, 16, 24, 40)),
    "n_steps": OneOf((32, 64, 128)),
    "batch_size": OneOf((1024, 2048, 4096, 8192)),
    "n_epochs": OneOf((2, 4, 8)),
    "log_std_until": Real(0.3, 1.0),
}

# gSDE's noise over its weights' noise early in training is e^1.6, the norm of the last layer.
_WHITE = {"sde_sample_freq": 0, "log_std": (-2.0 + 1.6, -3.8 + 1.6)}

VARIANTS = {
    "recipe": ("the recipe", FAST),
    "three-samples": (
        "the paper's three samples, which do not tell their age",
        FAST.replace({"task.observation": "three-samples"}),
    ),
    "cheap-jerk": (
        "a third of the price for jerky actions, the paper's",
        FAST.replace({"reward.jerk": 0.05}),
    ),
    "white-noise": (
        "white exploration noise of the same size instead of gSDE",
        FAST.replace(_WHITE),
    ),
    "blind-critic": (
        "critic on the actor's observation",
        FAST.replace(privileged_critic=False),
    ),
    "no-event": ("no reward at the apex", FAST.replace({"reward.apex": 0})),
    "no-patience": (
        "the apex pays alike however soon it follows the last",
        FAST.replace({"reward.full_period": 1e-9}),
    ),
    "no-prediction": ("no predicted apex in flight", FAST.replace({"reward.predicted": 0})),
    "standing-starts": (
        "every episode starts standing",
        FAST.replace({"task.reset_distribution": "standing"}),
    ),
    "coarse-physics": ("physics at 2.5 ms in training", FAST.replace({"task.timestep": 2.5e-3})),
}
"""By name, what is different in words, and the recipe without one of its parts."""
