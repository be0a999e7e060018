"""What all benchmarks' verbs share."""

from hopping_leg.errors import UsageError


def at_least(least: int, **values: int) -> None:
    """Refuse options below their least sensible value."""
    for name, value in values.items():
        if value < least:
            raise UsageError(f"--{name} is {value} but must be {least} or more.")


def mm(metres: float | None) -> str:
    """Return a length in mm as a table shows it."""
    return "no hops" if metres is None else f"{metres * 1e3:.2f}"
