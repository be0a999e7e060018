"""Training: recipes, checkpoints that survive a kill, choice of snapshots, policy files."""

import os

from hopping_leg.sim.compiled import FOLDER

# Otherwise torch's import alone leaves a folder in the temporary one.
if FOLDER:
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", FOLDER)
