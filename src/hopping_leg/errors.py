"""Errors a user can act on: one sentence that says what is wrong, what was valid, what to do."""

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST = 1000


class HoppingLegError(Exception):
    """Base of every error that the command line prints as one sentence."""

    def __str__(self) -> str:
        """Return one printable line, whatever a file or a user put into it."""
        line = " ".join(super().__str__().split())
        line = "".join(c if c.isprintable() else "?" for c in line)
        return line if len(line) <= _LONGEST else f"{line[: _LONGEST // 2]}...{line[-200:]}"


Error = type[HoppingLegError]  # What a caller wants to be raised


class RobotError(HoppingLegError):
    """A robot file is missing, incomplete or physically impossible."""


class PhysicsError(HoppingLegError):
    """A simulation became unstable."""


class PolicyError(HoppingLegError):
    """A policy file is unreadable, foreign, or does not fit the robot or command."""


class ControllerError(HoppingLegError):
    """Someone's controller cannot be loaded, fails, or answers something else than torques."""


class UsageError(HoppingLegError):
    """An argument has no meaning here; the message names the valid ones."""


class TraceError(HoppingLegError):
    """A trace file is unreadable or has another layout."""


class RecordingError(HoppingLegError):
    """A recording cannot be read or believed; the message names file, column and row."""


class HardwareError(HoppingLegError):
    """Drives, wire or adapter are not as they must be; nothing has moved."""


def unknown_name(kind: str, name: str, valid: Iterable[str]) -> str:
    """Return the sentence for a name that does not exist, with the valid ones."""
    names = sorted(valid)
    lower = {one.lower(): one for one in names}
    near = get_close_matches(name.lower(), lower, n=1)
    hint = f" Did you mean '{lower[near[0]]}'?" if near else ""
    return f"There is no {kind} '{name}'.{hint} Available: {', '.join(names)}."
