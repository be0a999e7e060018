"""Checkpoints that survive a kill at any moment: directories of arrays and JSON.

A checkpoint is written beside its final name, flushed to disk, and renamed, so that a directory
with a final name is always whole. Nothing is pickled.
"""

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.errors import TraceError, UsageError
from hopping_leg.io import one_line, parse_json

Tree = dict[str, Any]
"""Nested dictionaries and lists of arrays and JSON values, with text keys."""

SCHEMA = 1
"""Version of the layout."""

KEPT = 2
"""Checkpoints kept in a run."""

_PREFIX = "checkpoint-"
_ARRAY = "__array__"


def write_checkpoint(folder: Path, steps: int, tree: Tree) -> Path:
    """Write ``folder/checkpoint-<steps>`` and delete all but the newest ``KEPT``.

    Raises:
        TraceError: It cannot be written; nothing of it is left.
    """
    final = folder / f"{_PREFIX}{steps:012d}"
    part = folder / f"{final.name}.tmp"
    if final.exists():
        return final
    shutil.rmtree(part, ignore_errors=True)
    arrays: dict[str, Any] = {}
    plain = _split(tree, "", arrays)
    try:
        part.mkdir(parents=True)
        with (part / "arrays.npz").open("wb") as file:
            np.savez(file, **arrays)
            _flush(file)
        with (part / "state.json").open("w", encoding="utf-8") as file:
            json.dump({"schema": SCHEMA, "tree": plain, "sha256": _digest(part, plain)}, file)
            _flush(file)
        _flush_folder(part)
        part.rename(final)
        _flush_folder(folder)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise TraceError(f"Cannot write {final}: {error.strerror}; nothing was changed.") from error
    for old in list_checkpoints(folder)[:-KEPT]:
        shutil.rmtree(old)
    return final


def list_checkpoints(folder: Path) -> list[Path]:
    """Return the whole checkpoints of a run, oldest first."""
    return sorted(p for p in folder.glob(f"{_PREFIX}*") if p.suffix != ".tmp" and p.is_dir())


def read_checkpoint(path: Path) -> Tree:
    """Read a checkpoint; raise ``UsageError`` where it is damaged or of another schema."""
    try:
        stored = parse_json((path / "state.json").read_bytes(), "its state")
        if stored["schema"] != SCHEMA:
            raise UsageError(f"its schema is {stored['schema']}; this version reads {SCHEMA}")
        if stored.get("sha256", "") not in ("", _digest(path, stored["tree"])):
            raise UsageError("its checksum does not fit")
        with np.load(path / "arrays.npz", allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        tree: Tree = _join(stored["tree"], arrays)
    except Exception as error:  # numpy and zipfile raise many unrelated types
        raise UsageError(
            f"Checkpoint {path} is damaged ({one_line(error)}); delete it to resume from the one"
            " before."
        ) from error
    return tree


def _digest(path: Path, plain: Any) -> str:  # noqa: ANN401
    """Return the SHA-256 of a checkpoint's arrays and the rest of its tree."""
    with (path / "arrays.npz").open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
    digest.update(json.dumps(plain).encode())
    return digest.hexdigest()


def _split(node: Any, path: str, arrays: dict[str, Any]) -> Any:  # noqa: ANN401
    """Return the tree with arrays moved to ``arrays``, a mark in the place of each."""
    if isinstance(node, dict):
        return {str(key): _split(value, f"{path}/{key}", arrays) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_split(value, f"{path}/{index}", arrays) for index, value in enumerate(node)]
    if isinstance(node, np.ndarray):
        if node.dtype.hasobject:
            raise TypeError(f"'{path}' is an array of objects, which only a pickle could hold")
        name = str(len(arrays))
        arrays[name] = node
        return {_ARRAY: name}
    if isinstance(node, np.generic):
        return node.item()
    return node


def _join(node: Any, arrays: dict[str, Any]) -> Any:  # noqa: ANN401
    if isinstance(node, dict):
        if _ARRAY in node:
            return arrays[node[_ARRAY]]
        return {key: _join(value, arrays) for key, value in node.items()}
    if isinstance(node, list):
        return [_join(value, arrays) for value in node]
    return node


def _flush(file: Any) -> None:  # noqa: ANN401
    file.flush()
    os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
