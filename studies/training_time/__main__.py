"""Run the study: ``python -m studies.training_time --help``."""

import sys

from studies.shared import main
from studies.training_time.run import Training

if __name__ == "__main__":
    sys.exit(main("training_time", Training))
