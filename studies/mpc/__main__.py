"""Run the study: ``python -m studies.mpc --help``."""

import sys

from studies.mpc.run import Options
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("mpc", Options))
