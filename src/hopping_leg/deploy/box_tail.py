"""A black box read while it grows, by another process than the one that writes it."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hopping_leg.deploy.black_box import HEADER, MAGIC, ROW, frames
from hopping_leg.errors import TraceError


class BoxTail:
    """Reads what is new in a black box.

    Attributes:
        path: Of the file.
        columns: Of the rows; empty until the header is there.
        header: Facts about the run; empty until the header is there.

    Args:
        path: As above.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.columns: tuple[str, ...] = ()
        self.header: dict[str, Any] = {}
        self._rest = b""
        self._begun = False
        try:
            self._file = path.open("rb", buffering=0)
        except OSError as error:
            raise TraceError(f"Cannot read {path}: {error.strerror}.") from error

    @property
    def over(self) -> bool:
        """Whether the file is gone: the run has ended and left its trace."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    def rows(self) -> npt.NDArray[np.float64]:
        """Return the rows that were written since the last call, (ticks, columns).

        Raises:
            TraceError: The file is no black box.
        """
        content = self._rest + self._file.read()
        at = 0
        if not self._begun:
            if len(content) < len(MAGIC):
                self._rest = content
                return np.empty((0, 0))
            if not content.startswith(MAGIC):
                raise TraceError(f"{self.path} is no black box of `hop deploy`.")
            at, self._begun = len(MAGIC), True
        found = []
        for kind, data, end in frames(content, at):
            at = end
            if kind == HEADER:
                first = json.loads(data)
                self.columns, self.header = tuple(first["columns"]), first["header"]
            elif kind == ROW:
                found.append(data)
        self._rest = content[at:]
        return np.frombuffer(b"".join(found), "<f8").reshape(len(found), len(self.columns))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
