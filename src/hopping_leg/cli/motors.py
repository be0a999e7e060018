"""What the verbs that talk to motors share; the client library is imported only here, and late."""

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hopping_leg.cli.options import answer, say, show_table
from hopping_leg.deploy import preflight
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.errors import UsageError
from hopping_leg.robot.parameters import JOINTS, Robot

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink


def connect(robot: Robot, transport: str) -> "contextlib.closing[MoteusLink]":
    """Open a robot's drives, to be closed; UsageError and HardwareError say why that fails."""
    from hopping_leg.deploy.moteus_link import MoteusLink
    from hopping_leg.deploy.transport import open_transport

    return contextlib.closing(MoteusLink(robot, open_transport(transport)))


def find(link: "MoteusLink", robot: Robot, limits: SafetyLimits) -> list[preflight.Finding]:
    """Return all checks of both drives, and of what measures the height."""
    from hopping_leg.deploy.drive_info import check_height, inspect

    return [*preflight.check_drives(robot, limits, inspect(link)), *check_height(link)]


def check(link: "MoteusLink", robot: Robot, limits: SafetyLimits) -> dict[str, dict[str, str]]:
    """Refuse unfit drives with a HardwareError; return what was found, for the trace."""
    findings = find(link, robot, limits)
    preflight.require_fit(findings)
    return {
        name: {f.check: f.found for f in findings if f.joint == joint}
        for joint, name in enumerate(JOINTS)
    }


def ask(question: str, *, yes: bool) -> None:
    """Ask the operator, unless ``yes``; UsageError if nobody can be asked or the answer is no."""
    if yes:
        return
    if (said := answer(f"{question} Type yes:")) is None:
        raise UsageError(f"{question} This needs your consent; call it in a terminal or add --yes.")
    if said.lower() not in ("y", "yes"):
        raise UsageError("You did not agree; nothing was done.")


def show(findings: Sequence[preflight.Finding]) -> None:
    """Print checks as a table and complaints as sentences."""
    found = {(f.check, f.joint): f.found for f in findings}
    names = dict.fromkeys(f.check for f in findings)
    rows = ((name, *(found.get((name, j), "") for j in range(len(JOINTS)))) for name in names)
    show_table(("check", *JOINTS), rows)
    say(*(f"- {f.complaint[0].upper()}{f.complaint[1:]}" for f in findings if f.complaint))
