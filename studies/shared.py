"""What every study's command shares: options, errors in a sentence, the JSON with its command."""

import importlib
import inspect
import sys
from collections.abc import Collection, Sequence
from typing import Any, get_args

from hopping_leg.cli import guard, read_options
from hopping_leg.cli.command_line import KEPT, command_line, verb_of
from hopping_leg.io import write_json


def main(
    name: str,
    options: Any,  # noqa: ANN401
    arguments: Sequence[str] | None = None,
    keep_out: Collection[str] = (),
) -> int:
    """Run a study, print its numbers, write the JSON; return the exit code.

    Args:
        name: Of the study, as in ``python -m studies.NAME``.
        options: Its options: a dataclass with a field ``json`` and a method ``measure``, or a union
            of such dataclasses, one for each part.
        arguments: Behind the name; default: those of the process.
        keep_out: Options that the stored command shall not name.
    """
    given = sys.argv[1:] if arguments is None else arguments
    return guard(lambda: _run(name, options, given, keep_out))


def _run(name: str, options: Any, given: Sequence[str], keep_out: Collection[str]) -> int:  # noqa: ANN401
    program = f"python -m studies.{name}"
    about = inspect.getdoc(importlib.import_module(f"studies.{name}"))
    args = read_options(options, program, about, given)
    if get_args(options):
        program = f"{program} {verb_of(args)}"
    command = command_line(program, args, KEPT | {"recordings", *keep_out})
    result = {"command": command, **args.measure()}
    if args.json is not None:
        write_json(args.json, result)
        print(f"Wrote {args.json}.")
    return 0
