"""Digests of a case's arrays, and what they depend on besides the code."""

import hashlib
import json
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("digests.json")

_LIBRARIES = (
    "numpy", "scipy", "torch", "mujoco", "onnx", "onnxruntime", "stable-baselines3", "polars",
    "moteus",
)  # fmt: skip
_SWITCHES = ("OPENBLAS_CORETYPE", "ATEN_CPU_CAPABILITY", "NPY_DISABLE_CPU_FEATURES", "MKL_CBWR")


def surroundings() -> dict[str, str]:
    """Return libraries and processor: where they are the same, so are all bits."""
    found = {}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    lines = set()
    if Path("/proc/cpuinfo").exists():
        words = ("flags", "Features", "model name", "cpu family", "model\t")
        lines = {s for s in Path("/proc/cpuinfo").read_text().splitlines() if s.startswith(words)}
    switches = [f"{name}={os.environ.get(name, '')}" for name in _SWITCHES]
    processor = "\n".join([platform.platform(terse=True), *sorted(lines), *switches])
    digest = hashlib.sha256(processor.encode()).hexdigest()[:16]
    return {**found, "machine": platform.machine(), "processor": digest}


def digest(arrays: list[np.ndarray]) -> str:
    """Return the SHA-256 of types, shapes and bytes."""
    total = hashlib.sha256()
    for array in arrays:
        array = np.ascontiguousarray(array)
        assert array.dtype != object
        total.update(f"{array.dtype.str} {array.shape}\n".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def summary(arrays: list[np.ndarray]) -> list[float]:
    """Return a few values: mean, mean square, first and last of eight groups of arrays."""
    flat = [np.nan_to_num(np.asarray(array, np.float64)).ravel() for array in arrays]
    groups = np.array_split(np.arange(len(flat)), min(8, len(flat)))
    joined = [np.concatenate([flat[i] for i in group]) for group in groups]
    return [float(v) for g in joined for v in (g.mean(), np.mean(g**2), g[0], g[-1])]


def stored() -> dict:
    """Return the stored digests."""
    return json.loads(FILE.read_text(encoding="utf-8"))
