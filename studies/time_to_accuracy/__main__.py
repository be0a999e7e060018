"""Run the study: ``python -m studies.time_to_accuracy --help``."""

from studies.shared import main
from studies.time_to_accuracy.run import TimeToAccuracy

if __name__ == "__main__":
    raise SystemExit(main("time_to_accuracy", TimeToAccuracy))
