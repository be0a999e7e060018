"""A reward term of your own: the recipe `paper` with a price on every torque.

Train it as ``hop train --recipe examples/custom_reward.py:QUIET``, or run this file as ``python
examples/custom_reward.py [STEPS]``; the default shows that every part works.
"""

import sys
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.envs import RewardTerm, Transition
from hopping_leg.rl.recipes.paper import PAPER
from hopping_leg.rl.run_folder import read_result
from hopping_leg.rl.train import train
from hopping_leg.robot import load_robot


def squared_torque(transition: Transition) -> Array:
    """Return the sum of the actions' squares, (n,)."""
    return np.sum(np.square(transition.action), axis=1)


QUIET = PAPER.replace(name="quiet", reward_terms=(RewardTerm("torque", -0.02, squared_torque),))

if __name__ == "__main__":
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 8_000
    folder = Path(f"runs/quiet-{steps}")
    recipe = QUIET.replace(steps=steps)
    if (folder / "policy.onnx").exists():
        print(f"{folder} holds a finished training; delete it to train again.")
    else:
        policy = train(recipe, load_robot(recipe.robot), 0, folder, resume=folder.exists())
        result = read_result(folder)
        print(f"{result['steps']} steps in {result['minutes']:.1f} minutes: {policy}")
