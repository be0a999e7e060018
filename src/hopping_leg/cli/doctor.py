"""Check the drives of a leg without moving it; write their configuration, tell them where they are.

Without a transport it says which extras of the package are missing, and the command for each.

Examples:
  hop doctor                                               # what is installed, what is not
  hop doctor --transport /dev/fdcanusb --robot legv2
  hop doctor --transport /dev/fdcanusb --robot my_leg.toml --write
  hop doctor --transport socketcan:can0 --home 0.0 0.0     # the leg hangs straight down
"""

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.console import Console

from hopping_leg.cli.extras import show_extras, survey
from hopping_leg.deploy.configuration import wanted
from hopping_leg.deploy.joint_transform import JOINTS
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.errors import HardwareError, UsageError
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE

if TYPE_CHECKING:
    from hopping_leg.deploy.preflight import Finding


@dataclass(frozen=True)
class Doctor:
    """Which drives, and what may be changed."""

    transport: str | None = None
    """Path of an fdcanusb, interface:channel of python-can, or pi3hat; without one only the
    installation is looked at."""
    robot: str = "legv2-paper"
    """A shipped robot or a .toml file; its table [hardware] says how the drives are wired."""
    write: bool = False
    """Write settings that are not as the robot's file asks, after asking."""
    home: tuple[float, float] | None = None
    """Where hip and knee stand now, rad: tells the drives which turn of their rotors it is."""
    yes: bool = False
    """Change things without asking."""


def run(args: Doctor) -> None:
    """Check, change what was asked for, check again."""
    if args.transport is None:
        if args.write or args.home is not None:
            raise UsageError("--write and --home need the drives; name their --transport.")
        show_extras(Console(), survey())
        return
    from hopping_leg.cli.motors import connect, find, show

    robot, console = load_robot(args.robot), Console()
    envelope = hopping_limits(robot, CONTROL_RATE)
    with connect(robot, args.transport) as link:
        findings = find(link, robot, envelope)
        if args.write:
            _write(link, robot, findings, console, yes=args.yes)
        if args.home is not None:
            _home(link, args.home, yes=args.yes)
        if args.write or args.home is not None:
            findings = find(link, robot, envelope)
    show(console, findings)
    if any(finding.complaint for finding in findings):
        raise HardwareError("The leg may not be armed; the sentences above say why.")
    console.print("The leg may be armed.")


def _write(
    link: Any,  # noqa: ANN401
    robot: Robot,
    findings: "list[Finding]",
    console: Console,
    *,
    yes: bool,
) -> None:
    """Write the settings that were found wrong."""
    from hopping_leg.cli.motors import ask

    inspection: Any = importlib.import_module("hopping_leg.deploy.drive_info")
    for joint, name in enumerate(JOINTS):
        wrong = {f.setting for f in findings if f.joint == joint and f.setting}
        settings = [setting for setting in wanted(robot, joint) if setting.name in wrong]
        if not settings:
            continue
        for setting in settings:
            console.print(f"{name}: {setting.name} = {setting.text} ({setting.why})")
        ask(f"These settings of the {name}'s drive will be written for good.", yes=yes)
        inspection.configure(link, joint, settings)


def _home(link: Any, angles: tuple[float, float], *, yes: bool) -> None:  # noqa: ANN401
    from hopping_leg.cli.motors import ask

    hip, knee = angles
    ask(f"The drives will take the hip for {hip:g} and the knee for {knee:g} rad.", yes=yes)
    inspection: Any = importlib.import_module("hopping_leg.deploy.drive_info")
    inspection.home(link, angles)
