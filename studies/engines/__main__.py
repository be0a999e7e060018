"""Run the study: ``python -m studies.engines --help``."""

import sys

from studies.engines.run import Engines
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("engines", Engines))
