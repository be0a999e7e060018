"""Behaviour is that of the stored digests, to the bit where libraries and processor are theirs."""

import warnings

import numpy as np
import pytest

from tests.golden.cases import CASES
from tests.golden.digests import digest, stored, summary, surroundings


def test_every_case_is_stored():
    assert list(stored()["cases"]) == list(CASES)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if c.slow else []) for n, c in CASES.items()]
)
def test_behaviour_is_unchanged(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arrays = CASES[name].compute(tmp_path)
    entry, here, there = stored()["cases"][name], surroundings(), stored()["surroundings"]
    values, expected = np.array(summary(arrays)), np.array(entry["summary"])
    assert len(values) == len(expected)
    error = np.abs(values - expected) / np.maximum(1.0, np.abs(expected))
    if here == there:
        assert digest(arrays) == entry["sha256"], f"summary differs by up to {error.max():.3g}"
        return
    differing = [key for key in there if here.get(key) != there[key]]
    warnings.warn(f"Compared by summary only: {', '.join(differing)} differ.", stacklevel=1)
    assert error.max() <= CASES[name].tolerance
