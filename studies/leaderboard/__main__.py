"""Run the study: ``python -m studies.leaderboard --help``."""

import sys

from studies.leaderboard.run import Leaderboard
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("leaderboard", Leaderboard))
