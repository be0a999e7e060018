"""Search a recipe with Optuna: `pip install optuna`, then `python tune.py 20 500000`.

A trial is a short training; its score, m, is the one by which `hop train` selects. The study is a
file: the same command goes on with it, and several processes may share it. The best trial of many
has been lucky as well as good: train its numbers again with other seeds and evaluate the policies.
"""

import json
import sys
from pathlib import Path

import optuna

from hopping_leg.errors import HoppingLegError
from hopping_leg.rl import recipes
from hopping_leg.rl.train import train
from hopping_leg.robot import load_robot

TRIALS, STEPS = (int(word) for word in (sys.argv[1:] or ("20", "500000")))
OUT = Path("runs/tune")


def objective(trial: optuna.Trial) -> float:
    """Train with the sampled numbers, any that `hop train --set` knows; return the score, m."""
    numbers = {
        "learning_rate": trial.suggest_float("learning_rate", 2e-4, 4e-3, log=True),
        "gradient_steps": trial.suggest_categorical("gradient_steps", [4, 8, 16, 32]),
        "mixing_share": trial.suggest_float("mixing_share", 0.0, 0.5),
        "steps": STEPS,
    }
    recipe = recipes.change(recipes.get_recipe("fast"), [f"{k}={v}" for k, v in numbers.items()])
    folder = OUT / f"trial-{trial.number}"
    try:
        train(recipe, load_robot(recipe.robot), 0, folder, resume=True, threads=2)
    except HoppingLegError as error:
        raise optuna.TrialPruned(str(error)) from error
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return float(result["selected"]["score_m"])


OUT.mkdir(parents=True, exist_ok=True)
study = optuna.create_study(
    storage=f"sqlite:///{OUT / 'fast.db'}", study_name="fast", load_if_exists=True
)
study.optimize(objective, n_trials=TRIALS - len(study.trials))
print(f"{1000 * study.best_value:.1f} mm with {study.best_params}; all trials are finished.")
