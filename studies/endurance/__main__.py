"""Run the study: ``python -m studies.endurance --help``."""

import sys

from studies.endurance.run import Endurance
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("endurance", Endurance))
