"""Run the study: ``python -m studies.real_hops --help``."""

from studies.real_hops.run import RealHops
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("real_hops", RealHops))
