"""Run the study: ``python -m studies.time_to_accuracy --help``."""

import sys

from studies.shared import main
from studies.time_to_accuracy.run import TimeToAccuracy

if __name__ == "__main__":
    sys.exit(main("time_to_accuracy", TimeToAccuracy))
