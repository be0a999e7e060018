"""What all verbs share that talk to motors; the client library is imported only here, and late."""

import contextlib
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from hopping_leg.deploy.preflight import Finding, check_drives, require_fit
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import JOINTS, Robot

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink


@contextlib.contextmanager
def connect(robot: Robot, transport: str) -> "Iterator[MoteusLink]":
    """Open the way to a robot's drives.

    Args:
        robot: Whose drives.
        transport: As on the command line.

    Raises:
        UsageError: There is no such transport.
        HardwareError: It cannot be opened.
    """
    from hopping_leg.deploy.moteus_link import MoteusLink
    from hopping_leg.deploy.transport import opener

    link = MoteusLink(robot, opener(transport))
    try:
        yield link
    finally:
        link.close()


def find(link: "MoteusLink", robot: Robot, limits: SafetyLimits) -> list[Finding]:
    """Return all checks of both drives."""
    from hopping_leg.deploy.drive_info import inspect

    return check_drives(robot, limits, inspect(link))


def check(link: "MoteusLink", robot: Robot, limits: SafetyLimits) -> dict[str, dict[str, str]]:
    """Refuse drives that are not fit; return what was found, for the trace.

    Raises:
        HardwareError: Why they may not be armed.
    """
    findings = find(link, robot, limits)
    require_fit(findings)
    return {
        name: {f.check: f.found for f in findings if f.joint == joint}
        for joint, name in enumerate(JOINTS)
    }


def ask(question: str, *, yes: bool) -> None:
    """Wait for the operator's consent.

    Args:
        question: What will happen.
        yes: Whether consent was given on the command line.

    Raises:
        UsageError: Nobody can be asked.
    """
    if yes:
        return
    if not sys.stdin.isatty():
        raise UsageError(f"{question} This needs your consent; call it in a terminal or add --yes.")
    answer = input(f"{question} Type yes: ")
    if answer.strip().lower() not in ("y", "yes"):
        raise UsageError("You did not agree; nothing was done.")


def show(console: Console, findings: Sequence[Finding]) -> None:
    """Print checks as a table and complaints as sentences."""
    table = Table("check", *JOINTS)
    found = {(f.check, f.joint): f for f in findings}
    for name in dict.fromkeys(f.check for f in findings):
        cells = [found.get((name, joint)) for joint in range(len(JOINTS))]
        table.add_row(name, *(_cell(finding) for finding in cells))
    console.print(table)
    for complaint in (f.complaint for f in findings if f.complaint):
        console.print(f"- {complaint[0].upper()}{complaint[1:]}", soft_wrap=True, highlight=False)


def _cell(finding: Finding | None) -> str:
    if finding is None:
        return ""
    return f"[red]{finding.found}[/red]" if finding.complaint else finding.found
