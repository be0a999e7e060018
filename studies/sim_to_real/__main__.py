"""Run the study: ``python -m studies.sim_to_real --help``."""

from studies.shared import main
from studies.sim_to_real.run import Options

if __name__ == "__main__":
    raise SystemExit(main("sim_to_real", Options))
