"""Files of plain data: written whole or not at all, read into dataclasses with errors that help."""

import contextlib
import dataclasses
import json
import math
import os
import platform
import re
import tomllib
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

import msgspec

from hopping_leg.errors import Error, HoppingLegError, TraceError, UsageError, unknown_name

Tree = dict[str, Any]  # Nested tables as read from TOML or JSON

Kind = TypeVar("Kind")


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file whole or, with a TraceError, not at all, also where the process is killed."""
    path = path.resolve()
    part = path.with_name(path.name + ".part")
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(content)  # a device or pipe must not be replaced by a file
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException as error:  # also where it is interrupted
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise TraceError(f"Cannot write {path}: {error.strerror}; nothing was changed.") from error


def write_json(path: Path, value: object) -> None:
    """Write a value as readable JSON, see ``plain``, as ``write_atomically`` does."""
    text = json.dumps(plain(value), indent=1, allow_nan=False)
    write_atomically(path, f"{text}\n".encode())


_MOST_DIGITS = 300  # Of an integer; longer ones do not fit the numbers that they are computed with


def parse_json(content: bytes | str, origin: str, error: Error = UsageError) -> Tree:
    """Return the object that JSON holds; ``error`` says that it is damaged or no object."""
    return _parse(json.loads, content, origin, "readable as JSON", error)


def parse_toml(content: bytes, origin: str, error: Error = UsageError) -> Tree:
    """Return the tables that TOML holds; ``error`` says where it is damaged."""
    return _parse(lambda text: tomllib.loads(text.decode()), content, origin, "valid TOML", error)


def _parse(
    read: Callable[[Any], Any], content: object, origin: str, form: str, error: Error
) -> Tree:
    try:
        tree = read(content)
    except (ValueError, RecursionError) as problem:
        raise error(f"{origin} is not {form}: {one_line(problem)}.") from problem
    if not isinstance(tree, dict):
        raise error(f"{origin} holds {one_line(tree)} but must hold a table with names.")
    return tree


def one_line(value: object, most: int = 120) -> str:
    """Return a value as a text for a message: one line, and not a long one."""
    try:
        text = str(value) if isinstance(value, BaseException) else repr(value)
    except (ValueError, RecursionError):  # a number of too many digits, or nested too deeply
        text = f"a value of type {type(value).__name__}"
    text = " ".join(text.split())
    return (text if len(text) <= most else f"{text[:most]}...").rstrip(".")


def plain(value: Any) -> Any:  # noqa: ANN401
    """Return a value with lists for tuples and null for numbers that JSON does not know (NaN)."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def safe_file_name(text: str) -> str:
    """Return a text's first 80 characters, all but letters, digits, ``-_.`` replaced by ``_``."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in text[:80])


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python and of those packages that are installed."""
    found = {"python": platform.python_version()}
    for package in packages:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def replace_at(tree: Kind, path: str, value: object) -> Kind:
    """Return nested dataclasses or dictionaries, made where missing, with an entry replaced."""
    name, _, rest = path.partition(".")
    if isinstance(tree, dict):
        inner = replace_at(tree.get(name, {}), rest, value) if rest else value
        return cast(Kind, {**tree, name: inner})
    inner = replace_at(getattr(tree, name), rest, value) if rest else value
    return dataclasses.replace(tree, **{name: inner})  # type: ignore[type-var]


def quantity(unit: str, default: float | None, **valid: bool) -> Any:  # noqa: ANN401
    """Return a field of a dataclass that is a number with a unit, and may be left out.

    Give ``zero`` or ``signed`` where zero, or any sign, is valid beside positive numbers.
    """
    return dataclasses.field(default=default, metadata={"unit": unit, **valid})


def read_dataclass(
    kind: type[Kind], tree: object, origin: str, *, error: Error = UsageError
) -> Kind:
    """Return the dataclass that a table, field names to values, describes, by ``msgspec.convert``.

    Beyond that, unknown fields are refused, and numbers that are not finite. The origin, e.g. a
    file, is for messages.

    Raises:
        HoppingLegError: Naming the field and what was valid; ``error`` unless ``kind`` raised it.
    """
    _check(kind, tree, "", origin, error)
    try:
        return msgspec.convert(tree, kind)
    except msgspec.ValidationError as problem:
        what, _, where = str(problem).partition(" - at `")
        field = re.sub(r"^\$\.?|`$", "", where)
        raise error(f"{origin}: {f'{field!r}: ' if field else ''}{what}.") from None
    except HoppingLegError as problem:
        raise type(problem)(f"{origin}: {problem}") from None


def _check(kind: Any, value: object, path: str, origin: str, error: Error) -> None:  # noqa: ANN401
    """Refuse unknown fields, values beyond the choices, and numbers that are not finite."""
    subject = f"{origin}: '{path}'"
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if choices and (not isinstance(value, str | int) or value not in choices):
        named = value if isinstance(value, str) else one_line(value)
        raise error(f"{subject}: {unknown_name('value', named, map(str, choices))}")
    if isinstance(value, list | tuple):
        for number, entry in enumerate(value):
            _check(None, entry, f"{path}[{number}]", origin, error)
    elif isinstance(value, dict) and dataclasses.is_dataclass(kind):
        specs = {spec.name: spec for spec in dataclasses.fields(kind)}
        hints = get_type_hints(kind)
        for key, entry in value.items():
            if key not in specs:
                where = f"field in [{path}]" if path else "field"
                raise error(f"{origin}: {unknown_name(where, str(key), specs)}")
            at = f"{path}.{key}" if path else key
            _check(hints[key], entry, at, origin, error)
    elif isinstance(value, int | float) and not isinstance(value, bool) and not is_number(value):
        raise error(f"{subject} is {one_line(value)} but must be a finite number.")


def is_number(value: object) -> bool:
    """Tell whether a value is a finite number and no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) if isinstance(value, float) else abs(value) < 10**_MOST_DIGITS
