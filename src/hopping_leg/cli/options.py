"""Option types that several verbs share."""

from typing import Annotated

import tyro

from hopping_leg.errors import UsageError


def parse_heights(text: str) -> tuple[float, ...]:
    """Read comma-separated heights, m.

    Raises:
        UsageError: An entry is not a number.
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise UsageError(
            f"'{text}' is not a list of heights; give metres separated by commas, e.g. 0.25,0.30."
        ) from error


Heights = Annotated[
    tuple[float, ...],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="M,M,...",
        instance_from_str=lambda words: parse_heights(words[0]),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda heights: [",".join(f"{h:g}" for h in heights)],
    ),
]
"""Heights in metres, given as ``0.25,0.30``."""


def at_least(least: int, **values: int) -> None:
    """Refuse options below their least sensible value."""
    for name, value in values.items():
        if value < least:
            raise UsageError(f"--{name} is {value} but must be {least} or more.")


def mm(metres: float | None) -> str:
    """Return a length in mm as a table shows it."""
    return "no hops" if metres is None else f"{metres * 1e3:.2f}"
