"""Run the study: ``python -m studies.energy_shaping --help``."""

from studies.energy_shaping.run import Baseline
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("energy_shaping", Baseline))
