"""Results that are kept, so that a killed benchmark goes on."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopping_leg.io import write_json


@dataclass(frozen=True)
class ResultCache:
    """Runs work once: its result lies in a folder and is taken from there the next time."""

    folder: Path
    on_begin: Callable[[str], None] = lambda words: None
    """Told, in words, what begins."""

    def load_or_run(
        self, name: str, words: str, asked: dict[str, Any], work: Callable[[], dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the kept result of the same work, or do it and keep its result.

        ``asked`` is all that the result depends on; it and the result are JSON values.
        """
        file = self.folder / f"{name}.json"
        asked = json.loads(json.dumps(asked))
        if file.exists():
            kept: dict[str, Any] = json.loads(file.read_bytes())
            if kept["asked"] == asked:
                return dict(kept["result"])
        self._begin(name, asked)
        self.on_begin(words)
        result = work()
        write_json(file, {"asked": asked, "result": result})
        return dict(json.loads(file.read_bytes())["result"])

    def _begin(self, name: str, asked: dict[str, Any]) -> None:
        """Prepare for work that is not kept yet."""
