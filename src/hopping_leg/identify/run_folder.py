"""The folder of one identification: what was asked for, checkpoints of its searches, result."""

import json
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically, write_json


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


_CONFIG, _RESULT = "config.json", "result.json"


class RunFolder:
    """Files of one run.

    Args:
        path: The folder.
        config: What makes this run this run, as JSON values.
    """

    def __init__(self, path: Path, config: dict[str, Any]) -> None:
        self.path, self._config = path, json.loads(json.dumps(config))

    def begin(self, *, resume: bool) -> None:
        """Prepare the folder.

        The run in it goes on if it is the same one and unfinished.

        Args:
            resume: Go on with a finished run, too, instead of replacing it.

        Raises:
            UsageError: It holds another run that is unfinished, or to be resumed, or something
                else than a run.
        """
        config = self.path / _CONFIG
        checkpoints = list(self.path.glob("search-*.json"))
        finished = (self.path / _RESULT).exists()
        if not config.exists():
            if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
                raise UsageError(f"{self.path} is not empty and holds no run; give another folder.")
        elif checkpoints and (resume or not finished):
            self._check_same(config)
            return
        for file in (*checkpoints, self.path / _RESULT):
            file.unlink(missing_ok=True)
        write_json(config, self._config)

    def finish(self, result: dict[str, Any]) -> None:
        """Write the result, or why there is none; either marks the run as finished."""
        write_json(self.path / _RESULT, result)

    def _check_same(self, config: Path) -> None:
        try:
            stored = json.loads(config.read_bytes())
            differences = [k for k, v in self._config.items() if stored.get(k) != v]
        except (ValueError, AttributeError) as error:
            raise UsageError(f"{config} is no run's; give another folder.") from error
        if differences:
            raise UsageError(
                f"The run in {self.path} began with another {differences[0].replace('_', ' ')};"
                " go on with what it began with, or give another --folder."
            )
