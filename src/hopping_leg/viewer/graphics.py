"""How many pixels a browser on this computer can be asked to draw."""

import sys
from pathlib import Path

COARSE = 0.4
"""Pixels drawn per pixel of the screen, each way, where a processor has to shade them."""

_DEVICES = ("dri/renderD*", "nvidia[0-9]*", "dxg")


def has_gpu(devices: Path = Path("/dev")) -> bool:
    """Tell whether this computer has something to draw with, as far as its system shows it.

    Args:
        devices: Where Linux lists its devices; other systems always have one.
    """
    if sys.platform != "linux":
        return True
    return any(found for pattern in _DEVICES for found in devices.glob(pattern))


def detail() -> float | None:
    """Return how many pixels to draw per pixel of the screen, each way; None: the page decides."""
    return None if has_gpu() else COARSE
