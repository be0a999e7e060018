"""What all verbs share that talk to motors; the client library is imported only here, and late."""

import contextlib
import importlib
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from hopping_leg.deploy.joint_transform import JOINTS
from hopping_leg.deploy.preflight import Finding, judge, require
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.deploy.transport import opener
from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import Robot

if TYPE_CHECKING:
    from hopping_leg.deploy.driver import MoteusLink


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
    open_transport = opener(transport)
    driver: Any = importlib.import_module("hopping_leg.deploy.driver")
    link: MoteusLink = driver.MoteusLink(robot, open_transport)
    try:
        yield link
    finally:
        link.close()


def find(link: "MoteusLink", robot: Robot, envelope: SafetyLimits) -> list[Finding]:
    """Return all checks of both drives."""
    inspection: Any = importlib.import_module("hopping_leg.deploy.drive_info")
    return judge(robot, envelope, inspection.inspect(link))


def check(link: "MoteusLink", robot: Robot, envelope: SafetyLimits) -> dict[str, dict[str, str]]:
    """Refuse drives that are not fit; return what was found, for the trace.

    Raises:
        HardwareError: Why they may not be armed.
    """
    findings = find(link, robot, envelope)
    require(findings)
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
