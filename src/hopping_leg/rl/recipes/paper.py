"""The paper's recipe: soft actor-critic with state-dependent exploration (Sec. II-C).

The paper gives network, reward, weights, noise and delay; the hyper-parameters of SAC, what ends an
episode and what the critics see are chosen here.
"""

from hopping_leg.envs import PaperRewardConfig, TaskConfig
from hopping_leg.rl import recipe, sac
from hopping_leg.rl.search_space import OneOf, Real, SearchSpace

_LAYERS = OneOf(((128, 128), (256, 256), (256, 256, 128, 128)))

PAPER = recipe.Recipe(
    name="paper",
    task=TaskConfig(
        reset_distribution="mixed",
        random_episode_start=True,
        fall_clearance=0.01,
        fall_penalty=20.0,
    ),
    reward=PaperRewardConfig(),
    algorithm=sac.SACConfig(),
    network=sac.NetworkConfig(actor=(256, 256, 128, 128), critic=(256, 256, 128, 128)),
    schedule=recipe.Schedule(num_envs=16, steps=240_000, log_every=32),
    selection=recipe.SelectionConfig(eval_every=8_000),
    robot="legv2-paper",
)

SEARCH_SPACE: SearchSpace = {
    "learning_rate": Real(1e-4, 3e-3, log=True),
    "actor": _LAYERS,
    "critic": _LAYERS,
    "batch_size": OneOf((128, 256, 512)),
    "n_steps": OneOf((1, 3, 5)),
    "tau": Real(1e-3, 2e-2, log=True),
    "gamma": Real(0.97, 0.997),
    "train_freq": OneOf((8, 16, 32, 64)),
    "gradient_steps": OneOf((32, 64, 128, 256)),
    "target_entropy": Real(-4.0, 0.0),
    "log_std": Real(-3.5, -1.0),
}
