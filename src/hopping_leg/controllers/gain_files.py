"""Gain files: one TOML per tuned set of energy shaping, beside the leg it was found on."""

import dataclasses
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from hopping_leg.controllers.shaping_gains import ShapingGains
from hopping_leg.errors import UsageError
from hopping_leg.io import read_dataclass, write_atomically

_SHIPPED = resources.files("hopping_leg.controllers") / "gains"
_NAMES = [field.name for field in dataclasses.fields(ShapingGains)]

TUNED = "energy-shaping"
"""Name of the shipped set."""


@dataclasses.dataclass(frozen=True)
class GainFile:
    """A tuned set.

    Attributes:
        robot: Name or path of the leg it was found on.
        source: How it was found.
        gains: The set.
    """

    robot: str
    source: str
    gains: ShapingGains


def load_gains(name_or_path: str | Path = TUNED) -> GainFile:
    """Load a tuned set by shipped name or from a TOML file.

    Raises:
        UsageError: The file is missing or not a gain file; the message names the field.
    """
    name = str(name_or_path)
    source: Any = Path(name) if name.endswith(".toml") else _SHIPPED / f"{name}.toml"
    try:
        tree = tomllib.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"There is no gain file {source}; write one with `hop tune`.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{source} is not valid TOML: {error}.") from error
    return read_dataclass(GainFile, tree, name)


def save_gains(path: Path, found: GainFile) -> None:
    """Write a tuned set; an existing file is replaced only once the new one is complete."""
    lines = [f"robot = {_quoted(found.robot)}", f"source = {_quoted(found.source)}", "", "[gains]"]
    lines += [f"{name} = {float(getattr(found.gains, name))!r}" for name in _NAMES]
    write_atomically(path, ("\n".join(lines) + "\n").encode())


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
