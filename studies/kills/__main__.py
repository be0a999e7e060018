"""Run the study: ``python -m studies.kills --help``."""

import sys

from studies.kills.run import Kills
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("kills", Kills))
