"""Run the study: ``python -m studies.limits --help``."""

import sys

from studies.limits.run import Limits
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("limits", Limits))
