"""Run the study: ``python -m studies.real_hops --help``."""

import sys

from studies.real_hops.run import RealHops
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("real_hops", RealHops))
