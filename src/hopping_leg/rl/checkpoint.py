"""Checkpoints that survive a kill at any moment: files of tensors and plain values.

A checkpoint is written beside its final name, flushed to disk, and renamed, so that a file with a
final name is always whole. Reading one runs no code that it may hold.
"""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from hopping_leg.errors import UsageError
from hopping_leg.io import one_line, write_atomically

Tree = dict[str, Any]
"""Nested dictionaries and lists of arrays, tensors and plain values."""

KEPT = 2
"""Checkpoints kept in a run."""


def write_checkpoint(folder: Path, steps: int, tree: Tree) -> Path:
    """Write ``folder/checkpoint-<steps>.pt`` and delete all but the newest ``KEPT``.

    Raises:
        TraceError: It cannot be written; nothing of it is left.
    """
    path, content = folder / f"checkpoint-{steps:012d}.pt", io.BytesIO()
    torch.save(_stored(tree), content)
    write_atomically(path, content.getvalue())
    for old in list_checkpoints(folder)[:-KEPT]:
        old.unlink()
    return path


def list_checkpoints(folder: Path) -> list[Path]:
    """Return the whole checkpoints of a run, oldest first."""
    return sorted(folder.glob("checkpoint-*.pt"))


def read_checkpoint(path: Path) -> Tree:
    """Read a checkpoint; raise ``UsageError`` where it is damaged."""
    try:
        with zipfile.ZipFile(path) as file:
            if (damaged := file.testzip()) is not None:  # torch checks no sums
                raise UsageError(f"the checksum of {damaged} does not fit")
        tree: Tree = _as_it_was(torch.load(path, weights_only=True))
    except Exception as error:  # torch and zipfile raise many unrelated types
        raise UsageError(
            f"Checkpoint {path} is damaged ({one_line(error)}); delete it to resume from the one"
            " before."
        ) from error
    return tree


def _stored(node: Any) -> Any:  # noqa: ANN401
    """Return nested containers with arrays as tensors, each alone in a tuple."""
    if isinstance(node, dict):
        return {key: _stored(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_stored(value) for value in node]
    if isinstance(node, np.generic):
        return node.item()
    if isinstance(node, np.ndarray):  # read-only where it comes from a cluster
        return (torch.from_numpy(np.require(node, None, "W")),)
    return node


def _as_it_was(node: Any) -> Any:  # noqa: ANN401
    """Return nested containers with arrays in the place of tuples."""
    if isinstance(node, dict):
        return {key: _as_it_was(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_as_it_was(value) for value in node]
    return node[0].numpy() if isinstance(node, tuple) else node
