"""The adaptive recipe: `precise` on legs that differ, with a memory that corrects the command."""

from dataclasses import replace

from hopping_leg.rl.distillation.distillation import Distillation, StudentConfig
from hopping_leg.rl.recipe import Recipe, Schedule, SelectionConfig
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.recipes.precise import LEARNT
from hopping_leg.sim.randomization import WIDE_RANGES

ADAPTIVE = Recipe(
    name="adaptive",
    task=replace(
        LEARNT.task,
        command_range=(0.20, 0.42),
        command_skew=1.0,
        randomised=WIDE_RANGES,
        randomize_probability=0.5,
        nominal_fraction=0.5,
    ),
    reward=LEARNT.reward,
    algorithm=FAST.algorithm,
    network=FAST.network,
    schedule=Schedule(num_envs=512, steps=12_000_000, log_every=4),
    selection=SelectionConfig(
        eval_every=500_000,
        eval_start=0.7,
        eval_commands=(0.22, 0.25, 0.28, 0.31, 0.34, 0.37, 0.40),
    ),
    distillation=Distillation(
        teacher_share=0.4,
        teachers=1,
        student=StudentConfig(memory="integrator"),
        nominal_share=0.35,
        randomizations=40,
    ),
)
