"""Run the study: ``python -m studies.ablations --help``."""

import sys

from studies.ablations.run import Ablation
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("ablations", Ablation))
