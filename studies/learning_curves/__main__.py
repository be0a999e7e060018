"""Run the study: ``python -m studies.learning_curves --help``."""

import sys

from studies.learning_curves.run import Curves
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("learning_curves", Curves))
