"""Files of plain data: written whole or not at all, read into dataclasses with errors that help."""

import contextlib
import dataclasses
import json
import math
import os
import platform
import tomllib
import types
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from hopping_leg.errors import HoppingLegError, TraceError, UsageError, unknown_name

Tree = dict[str, Any]
"""Nested tables as read from TOML or JSON."""

Field = dataclasses.Field[Any]
Kind = TypeVar("Kind")

_FORMS = {str: "a text in quotes", bool: "true or false", int: "a whole number"}


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that a killed process or a full disk leaves the old one whole.

    Raises:
        TraceError: The file cannot be written.
    """
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
    """Write a value as readable JSON; an existing file stays whole if that fails.

    Raises:
        TraceError: The file cannot be written.
    """
    write_atomically(path, json_text(value).encode())


def json_text(value: object) -> str:
    """Return a value as readable JSON, see ``plain``."""
    return f"{json.dumps(plain(value), indent=1, allow_nan=False)}\n"


_MOST_DIGITS = 300
"""Of an integer; longer ones do not fit the numbers that they are computed with."""


def parse_json(
    content: bytes | str, origin: str, error: type[HoppingLegError] = UsageError
) -> Tree:
    """Return the object that JSON holds; ``error`` says that it is damaged or no object."""
    return _parse(_read_json, content, origin, "readable as JSON", error)


def _read_json(content: bytes | str) -> object:
    return json.loads(content, parse_int=_read_int)


def _read_int(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def parse_toml(content: bytes, origin: str, error: type[HoppingLegError] = UsageError) -> Tree:
    """Return the tables that TOML holds; ``error`` says where it is damaged."""
    return _parse(lambda text: tomllib.loads(text.decode()), content, origin, "valid TOML", error)


def _parse(
    read: Callable[[Any], Any],
    content: object,
    origin: str,
    form: str,
    error: type[HoppingLegError],
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
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def safe_file_name(text: str) -> str:
    """Return a text with all but letters, digits, ``-``, ``_`` and ``.`` replaced by ``_``."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in text)


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python and of those packages that are installed."""
    found = {"python": platform.python_version()}
    for package in packages:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def replace_at(tree: Kind, path: str, value: object) -> Kind:
    """Return nested dataclasses or dictionaries with the entry at a dotted path replaced.

    Dictionaries on the way are made where there are none.
    """
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
    kind: type[Kind],
    tree: object,
    origin: str,
    *,
    error: type[HoppingLegError] = UsageError,
    path: str = "",
    read_quantity: Callable[[object, Field, str], float] | None = None,
) -> Kind:
    """Return the dataclass that a table describes.

    Its fields may be texts, numbers, truth values, literals, tuples of these, dataclasses, and any
    of them or None. Numbers must be finite.

    Args:
        kind: The dataclass; a field's ``metadata["choices"]`` are all that it may be.
        tree: The table: field names to values.
        origin: Where it comes from, e.g. the file, for messages.
        error: Raised where something is wrong.
        path: Path of the table in the file, e.g. ``"hip.motor"``.
        read_quantity: Reads a number whose field has a ``unit`` in its metadata, given entry (None
            where it is missing), field and path; without it, such fields are plain numbers.

    Raises:
        HoppingLegError: Naming the field and what was valid; ``error`` unless ``kind`` raised it.
    """
    if not isinstance(tree, dict):
        raise error(f"{origin}: '{path or origin}' must be a table, not {one_line(tree)}.")
    specs: dict[str, Field] = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = get_type_hints(kind)
    for key in tree:
        if key not in specs:
            where = f"field in [{path}]" if path else "field"
            raise error(f"{origin}: {unknown_name(where, str(key), specs)}")
    values: Tree = {}
    for name, spec in specs.items():
        at = f"{path}.{name}" if path else name
        missing = name not in tree
        if missing and not spec.default is spec.default_factory is dataclasses.MISSING:
            continue
        if read_quantity is not None and "unit" in spec.metadata:
            values[name] = read_quantity(tree.get(name), spec, at)
        elif dataclasses.is_dataclass(inner := hints[name]) and not missing:
            values[name] = read_dataclass(
                cast("type[Any]", inner),
                tree[name],
                origin,
                error=error,
                path=at,
                read_quantity=read_quantity,
            )
        else:
            choices = spec.metadata.get("choices", ())
            if missing:
                form = _form(hints[name], choices)
                form += f" [{at}]" if form == "a table" else ""
                raise error(f"{origin}: '{at}' is missing; it needs {form}.")
            values[name] = _read(tree[name], hints[name], choices, f"{origin}: '{at}'", error)
    try:
        return kind(**values)
    except HoppingLegError as problem:
        raise type(problem)(f"{origin}: {problem}") from None


def _read(
    value: object,
    kind: Any,  # noqa: ANN401
    choices: tuple[str, ...],
    subject: str,
    error: type[HoppingLegError],
) -> object:
    """Return a value as its field's type, or say what was valid."""
    args = get_args(kind)
    if _is_optional(kind):
        return None if value is None else _read(value, args[0], choices, subject, error)
    if get_origin(kind) is Literal or choices:
        valid = choices or args
        if not isinstance(value, str | int) or value not in valid:
            named = value if isinstance(value, str) else one_line(value)
            raise error(f"{subject}: {unknown_name('value', named, map(str, valid))}")
        return value
    if get_origin(kind) is tuple and isinstance(value, list | tuple):
        kinds = [args[0]] * len(value) if args[-1] is Ellipsis else list(args)
        if len(kinds) == len(value):
            pairs = zip(value, kinds, strict=True)
            return tuple(_read(v, k, (), subject, error) for v, k in pairs)
    elif kind is float and is_number(value):
        return float(cast(float, value))
    elif kind in _FORMS and isinstance(value, kind) and (kind is bool) == isinstance(value, bool):
        return value
    if get_origin(kind) is dict and isinstance(value, dict):
        return value
    raise error(f"{subject} is {one_line(value)} but must be {_form(kind, choices)}.")


def is_number(value: object) -> bool:
    """Tell whether a value is a finite number and no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) if isinstance(value, float) else abs(value) < 10**_MOST_DIGITS


def _form(kind: Any, choices: tuple[str, ...]) -> str:  # noqa: ANN401
    """Return what a field may hold."""
    args = get_args(kind)
    if _is_optional(kind):
        return _form(args[0], choices)
    if get_origin(kind) is Literal or choices:
        return f"one of {', '.join(map(str, choices or args))}"
    if get_origin(kind) is tuple:
        pair = args == (float, float)
        return "a pair [hip, knee] of numbers" if pair else f"a list of {len(args)}"
    if dataclasses.is_dataclass(kind) or get_origin(kind) is dict:
        return "a table"
    return _FORMS.get(kind, "a finite number")


def _is_optional(kind: Any) -> bool:  # noqa: ANN401
    return isinstance(kind, types.UnionType) or get_origin(kind) is Union
