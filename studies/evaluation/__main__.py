"""Measure again what the study stores: ``python -m studies.evaluation``."""

import sys

from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("evaluation"))
