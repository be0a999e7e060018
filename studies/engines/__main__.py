"""Run the study: ``python -m studies.engines --help``."""

from studies.engines.run import Engines
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("engines", Engines))
