"""Where a training's curves go: TensorBoard always, Weights & Biases or Trackio if asked for."""

import importlib
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from stable_baselines3.common.logger import KVWriter, Logger, configure

from hopping_leg import errors, io

Log = Literal["tensorboard", "wandb", "trackio"]

PROJECT = "hopping-leg"
"""Project under which runs are filed there."""


def check_log(log: Log) -> None:
    """Raise ``UsageError``, with the command to install it, where what a log needs is missing."""
    if log == "tensorboard":
        return
    try:
        importlib.import_module(log)
    except ImportError as error:
        raise errors.UsageError(
            f"--log {log} needs the package {log}, which is not installed: pip install {log}."
        ) from error


def make_logger(folder: Path, log: Log, config: Mapping[str, Any]) -> Logger:
    """Return the logger of a folder's training, which shows the configuration beside the curves.

    Raises ``UsageError`` where the package is missing or does not start.
    """
    check_log(log)
    logger = configure(str(folder / "tensorboard"), ["tensorboard"])
    if log != "tensorboard":
        logger.output_formats.append(Dashboard(log, folder, config))
    return logger


class Dashboard(KVWriter):  # type: ignore[misc]
    """Curves for a package with ``init``, ``log`` and ``finish``; a resumed run goes on there."""

    def __init__(self, package: str, folder: Path, config: Mapping[str, Any]) -> None:
        self._module: Any = importlib.import_module(package)
        # Trackio knows a run again by its name, Weights & Biases by an identity.
        identity = {"id": _identity(folder)} if package == "wandb" else {}
        try:
            self._module.init(
                project=PROJECT,
                name=folder.resolve().name,
                config=dict(config),
                resume="allow",
                **identity,
            )
        except Exception as error:
            reason = (str(error) or type(error).__name__).splitlines()[0]
            raise errors.UsageError(
                f"{package} did not start: {reason}; set it up or leave --log out."
            ) from error

    def write(
        self,
        key_values: dict[str, Any],
        key_excluded: dict[str, tuple[str, ...]],
        step: int = 0,
    ) -> None:
        """Send the numbers of one step; texts and pictures are TensorBoard's alone."""
        numeric = (int, float, np.number)
        numbers = {k: float(v) for k, v in key_values.items() if isinstance(v, numeric)}
        self._module.log(numbers, step=step)

    def close(self) -> None:
        """Finish the run."""
        self._module.finish()


def _identity(folder: Path) -> str:
    """Return the run's identity, the same after every resumption."""
    file = folder / "wandb-id"
    if not file.exists():
        io.write_atomically(file, uuid.uuid4().hex[:8].encode())
    return file.read_text(encoding="utf-8")
