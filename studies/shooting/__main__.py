"""Run the study: ``python -m studies.shooting --help``."""

import sys

from studies.shared import main
from studies.shooting.run import Options

if __name__ == "__main__":
    sys.exit(main("shooting", Options))
