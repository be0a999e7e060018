"""Train a controller for a leg of your own, then let it hop.

Run it as ``python examples/train_your_own.py [STEPS]``; the recipe's own number of steps gives a
controller that hops well, the default here is only enough to see every part work. Killed, it goes
on when it is run again; finished, its policy hops again.
"""

import sys
from pathlib import Path

import numpy as np

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.rl.recipes.fast import FAST
from hopping_leg.rl.run_folder import read_result
from hopping_leg.rl.train import train
from hopping_leg.robot import load_robot

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
leg = load_robot(str(Path(__file__).parent / "my_leg.toml"))
recipe = FAST.replace(steps=steps)
folder = Path(f"runs/my_leg-{steps}")
file = folder / "policy.onnx"
if file.exists():
    print(f"{folder} holds a finished training; {file} is used.")
else:
    train(recipe, leg, 0, folder, resume=folder.exists())
    result = read_result(folder)
    print(f"{result['steps']} steps in {result['minutes']:.1f} minutes: {file}")

policy = load_controller(str(file), leg)
run = rollout(policy, RolloutConfig(leg), np.full((1000, 4), 0.30), seed=0)
height = run.data["height_m"][400:]
print(f"base between {height.min():.3f} and {height.max():.3f} m")
