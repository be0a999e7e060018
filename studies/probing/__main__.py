"""Run the study: ``python -m studies.probing --help``."""

import sys

from studies.probing.run import Probe
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("probing", Probe))
