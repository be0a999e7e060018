"""Write digests anew: ``python -m tests.golden.record [case ...]``, without names for all.

Only for a commit that says why the behaviour changes.
"""

import json
import sys
import tempfile
import time
from pathlib import Path

from tests.golden.cases import CASES
from tests.golden.digests import FILE, digest, stored, summary, surroundings


def record(names: list[str]) -> None:
    """Compute cases and store their digests; on another processor all must be computed."""
    if unknown := set(names) - set(CASES):
        sys.exit(f"There is no case {', '.join(sorted(unknown))}; there are {', '.join(CASES)}.")
    here = surroundings()
    old = stored() if FILE.exists() else {"surroundings": here, "cases": {}}
    if names and old["surroundings"] != here:
        sys.exit("Libraries or processor differ from those stored; record all cases, not some.")
    kept = {name: entry for name, entry in old["cases"].items() if names and name in CASES}
    for name in names or CASES:
        begun = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            arrays = CASES[name].compute(Path(folder))
        kept[name] = {"sha256": digest(arrays), "summary": summary(arrays)}
        same = "" if kept[name] == old["cases"].get(name) else ", changed"
        print(f"{name}: {time.monotonic() - begun:.1f} s{same}", flush=True)
    tree = {"surroundings": here, "cases": {name: kept[name] for name in CASES if name in kept}}
    lines = [f"  {json.dumps(name)}: {json.dumps(entry)}" for name, entry in tree["cases"].items()]
    text = f'{{"surroundings": {json.dumps(here)},\n "cases": {{\n'
    FILE.write_text(text + ",\n".join(lines) + "\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    record(sys.argv[1:])
