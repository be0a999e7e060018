"""The paper's recipe: soft actor-critic with state-dependent exploration (Sec. II-C).

The paper gives network, reward, weights, noise and delay; the hyper-parameters of SAC, what ends an
episode and what the critics see are chosen here.
"""

from hopping_leg.envs import PaperRewardConfig, TaskConfig
from hopping_leg.rl import learner, recipe, sac

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
    network=learner.NetworkConfig(actor=(256, 256, 128, 128), critic=(128, 128)),
    schedule=recipe.Schedule(num_envs=64, steps=240_000, log_every=128),
    selection=recipe.SelectionConfig(eval_every=16_000),
    robot="legv2-paper",
)
