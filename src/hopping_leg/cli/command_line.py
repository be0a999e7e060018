"""The command that makes a result again, to stand beside the result."""

import dataclasses
import re
import shlex
from collections.abc import Collection, Iterator
from typing import Any, get_args, get_type_hints

import tyro

KEPT = frozenset({"out", "folder", "figure", "resume", "jobs", "ray"})
"""Options that only say where results are kept and who computes them."""


def command_line(verb: str, args: Any, leave_out: Collection[str] = KEPT) -> str:  # noqa: ANN401
    """Return a command whose options have the values of a dataclass, as the shell reads it.

    Options with their default values are left out; those of dataclasses among the fields stand
    beside the others.

    Args:
        verb: What comes before the options, e.g. ``python -m studies.speed env``.
        args: The dataclass that tyro reads the options into.
        leave_out: Names of further fields to leave out.
    """
    before, behind = verb.split(), []
    for name, value, hint in _given(args, leave_out):
        marks = list(_marks(hint))
        flag = f"--{name.replace('_', '-')}"
        if isinstance(value, bool):
            behind.append(flag if value else f"--no-{flag[2:]}")
        elif any(mark is tyro.conf.Positional for mark in marks):
            before += _words(value, marks)
        else:
            behind += [flag, *_words(value, marks)]
    return shlex.join([*before, *behind])


def verb_of(args: object) -> str:
    """Return the name that tyro gives to a dataclass as a subcommand, e.g. ``energy-shaping``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", type(args).__name__).lower()


def _given(args: Any, leave_out: Collection[str]) -> Iterator[tuple[str, Any, Any]]:  # noqa: ANN401
    """Yield name, value and annotation of every field that differs from its default."""
    hints = get_type_hints(type(args), include_extras=True)
    for field in dataclasses.fields(args):
        value = getattr(args, field.name)
        if dataclasses.is_dataclass(value):
            yield from _given(value, leave_out)
        elif field.name not in leave_out and value != field.default:
            yield field.name, value, hints[field.name]


def _marks(hint: object) -> Iterator[object]:
    """Yield what an annotation says beside the type, of every type in it."""
    yield from getattr(hint, "__metadata__", ())
    for part in get_args(hint):
        yield from _marks(part)


def _words(value: object, marks: Collection[object]) -> list[str]:
    """Return a value as tyro reads it; the option's own reader says how, if it has one."""
    for mark in marks:
        if isinstance(mark, tyro.constructors.PrimitiveConstructorSpec):
            return mark.str_from_instance(value)
    if isinstance(value, tuple | list):
        return [str(entry) for entry in value]
    return [str(value)]
