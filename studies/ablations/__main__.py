"""Run the study: ``python -m studies.ablations --help``."""

from studies.ablations.run import Ablation
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("ablations", Ablation))
