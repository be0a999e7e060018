"""Tables of stored results in the studies' READMEs; ``python -m studies.readmes`` writes them all.

A study's ``TABLES`` name a macro of the documentation, a file of its results and what the macro
asks for; the last entry may be a dict of the records that count.
"""

import importlib
import sys
from pathlib import Path

from hopping_leg.io import write_atomically

ROOT = Path(__file__).parent.parent
START, END = "<!-- results -->\n", "<!-- /results -->\n"


def filled(name: str) -> str:
    """Return a study's README with its tables as the stored results have them."""
    text = (ROOT / "studies" / name / "README.md").read_text(encoding="utf-8")
    if START not in text:
        return text
    before, _, rest = text.partition(START)
    return before + START + _tables(name) + END + rest.partition(END)[2]


def _tables(name: str) -> str:
    if (docs := str(ROOT / "docs")) not in sys.path:
        sys.path.append(docs)
    tables: str = importlib.import_module("macros_results").tables(name)
    return tables.replace(f"(results/{name}/", "(results/")


def write(name: str) -> None:
    """Fill a study's README."""
    write_atomically(ROOT / "studies" / name / "README.md", filled(name).encode())


if __name__ == "__main__":
    for page in sorted(ROOT.glob("studies/*/README.md")):
        write(page.parent.name)
