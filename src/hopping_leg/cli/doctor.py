"""Check the drives of a leg without moving it; write their configuration, tell them where they are.

Without a transport it compiles what is compiled, so that nothing waits for it later.

Examples:
  hop doctor                                               # compiles
  hop doctor --transport /dev/fdcanusb --robot legv2
  hop doctor --transport /dev/fdcanusb --robot my_leg.toml --write
  hop doctor --transport socketcan:can0 --home 0.0 0.0     # the leg hangs straight down
"""

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hopping_leg.cli import motors, options
from hopping_leg.deploy import preflight, safety_limits
from hopping_leg.errors import HardwareError, UsageError
from hopping_leg.robot import CONTROL_RATE, DEFAULT_ROBOT, JOINTS, Robot, load_robot

if TYPE_CHECKING:
    from hopping_leg.deploy.moteus_link import MoteusLink


@dataclass(frozen=True)
class Doctor:
    """Which drives, and what may be changed."""

    transport: str | None = None
    """Path of an fdcanusb, interface:channel of python-can, or pi3hat; without one code is
    compiled."""
    robot: str = DEFAULT_ROBOT
    """A shipped robot or a .toml file; its table [hardware] says how the drives are wired."""
    write: bool = False
    """Write settings that are not as the robot's file asks, after asking."""
    home: tuple[float, float] | None = None
    """Where hip and knee stand now, rad: tells the drives which turn of their rotors it is."""
    yes: bool = False
    """Change things without asking."""


def run(args: Doctor) -> None:
    """Check, change what was asked for, check again."""
    changes = args.write or args.home is not None
    if args.transport is None:
        if changes:
            raise UsageError("--write and --home need the drives; name their --transport.")
        compile_everything()
        return
    robot = load_robot(args.robot)
    limits = safety_limits.hopping_limits(robot, CONTROL_RATE)
    with motors.connect(robot, args.transport) as link:
        findings = motors.find(link, robot, limits)
        if args.write:
            _write(link, robot, findings, yes=args.yes)
        if args.home is not None:
            from hopping_leg.deploy.drive_info import home

            hip, knee = args.home
            told = f"The drives will take the hip for {hip:g} and the knee for {knee:g} rad."
            motors.ask(told, yes=args.yes)
            home(link, args.home)
        if changes:
            findings = motors.find(link, robot, limits)
    motors.show(findings)
    if any(finding.complaint for finding in findings):
        raise HardwareError("The leg may not be armed; the sentences above say why.")
    options.say("The leg may be armed.")


def compile_everything() -> None:
    """Compile what simulation, environment and identification need, or load it; say where it is."""
    import numpy as np

    from hopping_leg.envs import HoppingEnv
    from hopping_leg.identify.simulate import compile_replay
    from hopping_leg.sim import compile_physics
    from hopping_leg.sim.compiled import FOLDER

    compile_physics()
    compile_replay()
    env = HoppingEnv(load_robot(DEFAULT_ROBOT))
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    options.say(f"compiled code: {FOLDER or 'no folder can be written; lost with each process'}")
    options.say(*missing(sys.platform))


def missing(system: str) -> tuple[str, ...]:
    """Return a line on each thing that a system, named as Python does, cannot do."""
    late = f"Not on {system}: real-time priority, locked memory, socketcan; ticks may be late."
    none = f"Not on {system}: fdcanusb, `hop emulate`, `hop deploy`, `hop record play --transport`."
    return {"linux": (), "darwin": (late,)}.get(system, (late, none))


def _write(
    link: "MoteusLink", robot: Robot, findings: list[preflight.Finding], *, yes: bool
) -> None:
    from hopping_leg.deploy.drive_info import configure

    for joint, name in enumerate(JOINTS):
        wrong = {f.setting for f in findings if f.joint == joint and f.setting}
        settings = [s for s in preflight.required_settings(robot, joint) if s.name in wrong]
        if settings:
            options.say(*(f"{name}: {s.name} = {s.text} ({s.why})" for s in settings))
            motors.ask(f"These settings of the {name}'s drive will be written for good.", yes=yes)
            configure(link, joint, settings)
