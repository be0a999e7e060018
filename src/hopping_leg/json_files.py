"""JSON files, written whole or not at all."""

import json
import math
from pathlib import Path
from typing import Any

from hopping_leg.trace import write_atomically


def write_json(path: Path, value: object) -> None:
    """Write a value as readable JSON; an existing file stays whole if that fails.

    Args:
        path: The file.
        value: See ``plain``.

    Raises:
        TraceError: The file cannot be written.
    """
    write_atomically(path, json_text(value).encode())


def json_text(value: object) -> str:
    """Return a value as readable JSON, see ``plain``."""
    return f"{json.dumps(plain(value), indent=1, allow_nan=False)}\n"


def plain(value: Any) -> Any:  # noqa: ANN401
    """Return a value with lists for tuples and null for numbers that JSON does not know (NaN)."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
