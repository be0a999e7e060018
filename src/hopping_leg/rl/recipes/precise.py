"""The precise recipe: one network from 0.7 s of joint samples to torques, taught by the true state.

The teacher is the shooting controller, which plans every push and need not learn. ``LEARNT`` has a
teacher that learns by PPO instead, with a reward that is calmer than that of ``fast``: the calmer
it is, the better it can be imitated. Its energy gain ends where hops are too high: otherwise it
learns one high hop for all commands, from which some never come back to the low ones.
"""

from dataclasses import replace

from hopping_leg.envs import ApexRewardConfig
from hopping_leg.rl import algorithms, recipe, search_space
from hopping_leg.rl.distillation.distillation import Distillation
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.robot import TIMESTEP

LEARNT = recipe.Recipe(
    name="precise",
    task=replace(
        FAST.task,
        observation="dated-long",
        command_range=(0.20, 0.46),
        command_skew=1.5,
        timestep=TIMESTEP,
        randomize_from_start=False,
    ),
    reward=ApexRewardConfig(
        width=(0.030, 0.006), energy=0.8, energy_beyond=0.05, jerk=0.5, effort=0.2
    ),
    algorithm=algorithms.PPOConfig(n_epochs=8),
    network=FAST.network,
    schedule=recipe.Schedule(num_envs=512, steps=10_000_000, log_every=4),
    selection=recipe.SelectionConfig(
        eval_every=500_000,
        eval_start=0.7,
        eval_commands=(0.225, 0.26, 0.295, 0.33, 0.365, 0.40, 0.435),
    ),
    distillation=Distillation(),
)

SHOOTING = {
    "teacher": "shooting",
    "task.action_torque": (6.0, 14.0),
    "task.command_range": (0.21, 0.42),
    "task.command_skew": 1.0,
    "task.episode": 8.0,
    "steps": 6_000_000,
    "eval_commands": (0.225, 0.26, 0.295, 0.33, 0.365, 0.40),
    "dagger_mixing_share": 0.2,
    "dagger.gradient_steps": 64,
    "dagger.batch_size": 2048,
}
"""What is different with a teacher that is computed."""

PRECISE = LEARNT.replace(SHOOTING)

SEARCH_SPACE: search_space.SearchSpace = {
    "learning_rate": search_space.Real(2e-4, 4e-3, log=True),
    "student.hidden": search_space.OneOf((*search_space.LAYERS, (512, 256))),
    "dagger_mixing_share": search_space.Real(0.0, 0.5),
}

GRU = {
    "task.observation": "dated",
    "task.command_skew": 1.0,
    "num_envs": 256,
    "n_steps": 128,
    "n_epochs": 4,
    "steps": 9_000_000,
    "teacher_share": 0.55,
    "teachers": 1,
    "student.memory": "gru",
    "dagger.gradient_steps": 24,
    "dagger.batch_size": 8192,
}
"""A gated recurrent unit on 50 ms instead of a window of 0.7 s. The paper finds that recurrent
networks bring no advantage (Sec. II-C). Errors are traced back through 128 control steps, longer
than a hop; a batch is made of whole sequences."""

VARIANTS = {
    "recipe": ("the recipe", PRECISE),
    "learnt-teacher": (
        "a teacher that learns by PPO; what follows changes a part of it",
        LEARNT,
    ),
    "one-teacher": ("one teacher with all the teachers' time", LEARNT.replace(teachers=1)),
    "all-heights-alike": (
        "low commands as often as high ones",
        LEARNT.replace({"task.command_skew": 1.0}),
    ),
    "energy-anywhere": (
        "the teacher's energy gain is paid at any height, and half as much",
        LEARNT.replace({"reward.energy": 0.4, "reward.energy_beyond": 0.0}),
    ),
    "four-passes": (
        "four passes over a rollout instead of eight",
        LEARNT.replace(n_epochs=4),
    ),
    "no-teacher": (
        "no teacher: reinforcement learning on the same inputs, as `fast` learns",
        FAST.replace(task=LEARNT.task, eval_commands=LEARNT.selection.eval_commands),
    ),
    "short-past": (
        "50 ms of dated samples instead of 0.7 s",
        LEARNT.replace({"task.observation": "dated"}),
    ),
    "recurrent": ("50 ms and a recurrent unit instead of 0.7 s", LEARNT.replace(GRU)),
    "jumpy-teacher": (
        "a teacher for whom jerky actions cost what they cost `fast`, and torque nothing",
        LEARNT.replace({"reward.jerk": FAST.value("reward.jerk"), "reward.effort": 0.0}),
    ),
    "no-aim": (
        "a teacher that is told the command itself",
        LEARNT.replace({"dagger.correction_rate": 0.0}),
    ),
    "newest-only": (
        "only the newest tenth of the ticks from which the policy learns",
        LEARNT.replace({"dagger.buffer_size": LEARNT.value("dagger.buffer_size") // 10}),
    ),
    "coarse-physics": ("physics at 1 ms in training", LEARNT.replace({"task.timestep": 1e-3})),
}
"""By name, what is different in words, and the recipe without one of its parts."""
