"""Run the study: ``python -m studies.identification --help``."""

from studies.identification.run import Identify
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("identification", Identify))
