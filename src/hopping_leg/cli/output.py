"""What verbs write."""

import json
from pathlib import Path

from hopping_leg.trace import write_atomically


def write_json(path: Path, value: object) -> None:
    """Write a value as readable JSON; an existing file stays whole if that fails.

    Raises:
        TraceError: The file cannot be written.
    """
    text = json.dumps(value, indent=2, allow_nan=False)
    write_atomically(path, f"{text}\n".encode())
