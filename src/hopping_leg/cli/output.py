"""What verbs write."""

import json
import math
from pathlib import Path

from hopping_leg.trace import write_atomically


def write_json(path: Path, value: object) -> None:
    """Write a value as readable JSON; an existing file stays whole if that fails.

    Numbers that do not exist (NaN, infinity) become null, as JSON knows no others.

    Raises:
        TraceError: The file cannot be written.
    """
    text = json.dumps(_finite(value), indent=2, allow_nan=False)
    write_atomically(path, f"{text}\n".encode())


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
