"""Run the study: ``python -m studies.max_height --help``."""

import sys

from studies.max_height.run import Reach
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("max_height", Reach))
