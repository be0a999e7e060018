"""Which extras of the package are installed, and how to get the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version

from packaging.requirements import Requirement
from rich.console import Console

PACKAGE = "hopping-leg"

PURPOSES = {
    "train": "train policies (hop train)",
    "tune": "search a recipe's numbers (hop tune)",
    "view": "watch the leg in the browser (hop view)",
    "hardware": "talk to the drives (hop deploy, hop doctor, hop emulate)",
    "pi3hat": "talk to the drives from a Raspberry Pi with a pi3hat",
    "bullet": "the leg in PyBullet (hop evaluate --engine pybullet)",
    "bench": "mujoco.sysid beside our fits (python -m studies.identification)",
    "cluster": "identify or tune on a Ray cluster (--ray)",
    "docs": "build the documentation (make docs)",
    "dev": "test and check a clone (make test, make check)",
}
"""Every extra, with what it is for."""


@dataclass(frozen=True)
class Extra:
    """State of one extra."""

    name: str
    purpose: str
    missing: tuple[str, ...]
    """Requirements that are absent or of a version that does not fit."""

    @property
    def command(self) -> str:
        """What installs it."""
        return f"pip install '{PACKAGE}[{self.name}]'"


def survey(requirements: Sequence[str] | None = None) -> list[Extra]:
    """Look at what is installed.

    Args:
        requirements: As a package's metadata states them; default: those of this package.
    """
    lines = requires(PACKAGE) or [] if requirements is None else requirements
    wanted = [Requirement(line) for line in lines]
    return [
        Extra(name, purpose, tuple(str_of(r) for r in wanted if _of(r, name) and not _met(r)))
        for name, purpose in PURPOSES.items()
    ]


def show_extras(console: Console, extras: Sequence[Extra]) -> None:
    """Print a line per extra, and the command for those that are missing."""
    for extra in extras:
        if not extra.missing:
            console.print(f"{extra.name}: installed; {extra.purpose}", highlight=False)
            continue
        console.print(
            f"{extra.name}: missing {', '.join(extra.missing)}; {extra.purpose}\n  {extra.command}",
            highlight=False,
            markup=False,
        )


def str_of(requirement: Requirement) -> str:
    """Return a requirement without its condition."""
    extras = f"[{','.join(sorted(requirement.extras))}]" if requirement.extras else ""
    return f"{requirement.name}{extras}{requirement.specifier}"


def _of(requirement: Requirement, extra: str) -> bool:
    marker = requirement.marker
    return (
        marker is not None
        and not marker.evaluate({"extra": ""})
        and marker.evaluate({"extra": extra})
    )


def _met(requirement: Requirement) -> bool:
    """Tell whether a requirement is installed, with the extras that it asks for."""
    try:
        found = version(requirement.name)
    except PackageNotFoundError:
        return False
    brought = [Requirement(line) for line in requires(requirement.name) or []]
    return requirement.specifier.contains(found, prereleases=True) and all(
        _met(other) for extra in requirement.extras for other in brought if _of(other, extra)
    )
