"""No mutated file ends in anything but one sentence; HOPPING_LEG_FUZZ says how many are tried."""

import json
import os
import subprocess
import sys

import pytest

from tests.fuzz import KINDS

COUNT = int(os.environ.get("HOPPING_LEG_FUZZ", "200"))
"""Files of each kind."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_mutated_file_ends_in_anything_but_a_sentence(kind):
    first, found = 0, []
    while first < COUNT:
        words = [sys.executable, "-m", "tests.fuzz", kind, str(COUNT), str(first)]
        done = subprocess.run(words, capture_output=True, text=True, errors="replace")
        lines = done.stdout.splitlines()
        found += [json.loads(line) for line in lines if line.startswith("{")]
        if lines and lines[-1] == "end":
            break
        begun = [int(line.split()[1]) for line in lines if line.startswith("begin")]
        assert begun, done.stderr[-2000:]
        found.append({"seed": begun[-1], "wrong": f"aborted: {done.stderr[-500:]}"})
        first = begun[-1] + 1
    assert not found, "\n".join(f"{kind} {f['seed']}: {f['wrong']}" for f in found[:20])
