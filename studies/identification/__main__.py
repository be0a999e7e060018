"""Run the study: ``python -m studies.identification --help``."""

import sys

from studies.identification.run import Identify
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("identification", Identify))
