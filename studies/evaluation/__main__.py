"""Measure again what the study stores: ``python -m studies.evaluation``."""

from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("evaluation"))
