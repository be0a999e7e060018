"""Renders the numbers of stored results into the Markdown pages: ``docs/render.py``."""

import runpy
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.argv[1:] = []
    runpy.run_path(str(Path(__file__).parents[1] / "docs/render.py"), run_name="__main__")
