"""State of a search on disk: JSON, replaced as a whole, tied to the search it belongs to."""

import json
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically


def save_state(path: Path | None, identity: dict[str, Any], state: dict[str, Any]) -> None:
    """Write a state; nothing happens without a path.

    Args:
        path: The file.
        identity: What makes this search this search.
        state: What it needs to go on; floats keep every bit.
    """
    if path is not None:
        text = json.dumps({"identity": identity, "state": state})
        write_atomically(path, text.encode())


def load_state(path: Path | None, identity: dict[str, Any]) -> dict[str, Any] | None:
    """Return the saved state, or None if there is none.

    Raises:
        UsageError: The file is no checkpoint, or one of another search.
    """
    if path is None or not path.exists():
        return None
    try:
        saved = json.loads(path.read_bytes())
        known, state = saved["identity"], saved["state"]
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise UsageError(
            f"{path} is no checkpoint of a search; remove it to start anew."
        ) from error
    if known != json.loads(json.dumps(identity)):
        raise UsageError(
            f"{path} belongs to a search with other parameters, data or options;"
            " repeat those, or remove it to start anew."
        )
    assert isinstance(state, dict)
    return state
