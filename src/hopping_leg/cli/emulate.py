"""Emulate a leg with its two drives behind a real wire, for `hop deploy` and `hop doctor`.

The emulator offers a serial terminal which the moteus client takes for an fdcanusb. Behind it two
drives, with their own mode machines, watchdogs and limits, turn the simulated leg in real time.
Ends with Ctrl-C.

Examples:
  hop emulate --robot legv2
  hop deploy fast --transport /dev/pts/5        # in another terminal, with the path printed here
  hop emulate --robot twin --faults faults.toml --link /tmp/leg
  hop emulate --no-homed --no-configured        # as a leg that was just put together

A fault script is TOML; `hop emulate --kinds` lists what it may name:
  [[fault]]
  kind = "late_reply"
  since = "flight"
  at = 2.0
  drive = "knee"
  value = 0.012
"""

import contextlib
import math
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hopping_leg.cli.options import at_least, say, say_next, show_table
from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.deploy.realtime import prefer_this_thread, uninterrupted
from hopping_leg.emulator.faults import KINDS, load_faults
from hopping_leg.emulator.mode_machine import Notice
from hopping_leg.robot import DEFAULT_ROBOT, JOINTS

if TYPE_CHECKING:
    from hopping_leg.emulator.drive import EmulatedDrive
    from hopping_leg.emulator.server import Server

_STATUS_PERIOD = 0.2  # s
_RECENTLY = 1.0  # Before the drives stopped, s


@dataclass(frozen=True)
class Emulate:
    """What is emulated and how the host reaches it."""

    robot: str = DEFAULT_ROBOT
    """A shipped robot or a .toml file; its [reality] stands behind the wire, too."""
    start_pose: tuple[str, ...] = ("stand",)
    """stand, crouch, stretch, zero (straight down), or angles of hip and knee, rad."""
    faults: Path | None = None
    """TOML script of faults and their times."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""
    configured: bool = True
    """Drives configured as the robot's file asks; else as their firmware is delivered."""
    homed: bool = True
    """Drives homed by hand; else they know their position within a turn of the rotor only."""
    held: bool = True
    """Somebody holds the leg until both drives are powered."""
    seed: int = 0
    """Seed of sensor noise and jitter."""
    realtime: bool = True
    """Take real-time priority where that is permitted, so that the drives answer in time."""
    seconds: float | None = None
    """Time after which the emulator ends; default: with Ctrl-C."""
    kinds: bool = False
    """List the kinds of faults and end."""


def run(args: Emulate) -> None:
    """Serve the emulated robot until it is over, and tell what happens."""
    if args.kinds:
        show_table(("kind", "what happens", "value", "unit", "lasts"), map(_kind_cells, KINDS))
        return
    at_least(0, seed=args.seed)
    from hopping_leg.emulator.server import EmulatorConfig, Server

    start = EmulatorConfig(
        robot=args.robot,
        pose=",".join(args.start_pose),
        configured=args.configured,
        homed=args.homed,
        held=args.held,
        seed=args.seed,
        faults=() if args.faults is None else load_faults(args.faults),
        link=args.link,
    )
    robot, port = start.build(), start.open()
    seconds = math.inf if args.seconds is None else args.seconds
    try:
        with _ending_signals() as over:
            ids = " and ".join(str(drive.id) for drive in robot.drives)
            say(f"Drives {ids} of {robot.robot.name} behind {port}")
            say_next(_deployment(args.robot, str(port)))
            sys.stdout.flush()
            if args.realtime and prefer_this_thread() is not None:
                say("Without real-time priority the drives may answer late under load.")
            server = Server(robot, port)
            display = _Display(server)
            server.on_turn = display.renew
            with uninterrupted():
                server.run(lambda: bool(over) or robot.time >= seconds)
            display.end()
    finally:
        port.close()


def _deployment(robot: str, port: str) -> list[str]:
    """Return the command that drives the leg, with a policy that is made for it, if any is."""
    from hopping_leg.controllers.registry import ENERGY_SHAPING, robot_of, shipped_policies

    fitting = [name for name in shipped_policies() if robot_of([name]) == robot]
    name = "fast" if "fast" in fitting else [*fitting, ENERGY_SHAPING][0]
    return ["hop", "deploy", name, "--robot", robot, "--transport", port]


def _kind_cells(name: str) -> tuple[str, ...]:
    kind = KINDS[name]
    words = {"inf": "on", "nan": "so many replies"}
    lasts = words.get(f"{kind.duration:g}", f"{kind.duration:g} s")
    return name, kind.text, f"{kind.value:g}" if kind.unit else "", kind.unit, lasts


@contextlib.contextmanager
def _ending_signals() -> Iterator[list[int]]:
    over: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, lambda n, _: over.append(n)) for number in numbers}
    try:
        yield over
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Display:
    """Events on lines of their own; the state on a line that is renewed, on a terminal only."""

    def __init__(self, server: "Server") -> None:
        self._server, self._robot = server, server.robot
        self._modes = [drive.machine.mode for drive in self._robot.drives]
        self._faults_shown = 0
        self._live = sys.stdout.isatty()
        self._due = time.monotonic()

    def renew(self) -> None:
        """Show what is new."""
        clear = "\r\x1b[K" if self._live else ""
        for line in self._events():
            print(f"{clear}{line}", flush=True)
        if self._live and time.monotonic() >= self._due:
            self._due = time.monotonic() + _STATUS_PERIOD
            print(f"{clear}{self._status(self._server.lost)}", end="", flush=True)

    def end(self) -> None:
        if self._live:
            print()
        print(f"The emulator ended after {self._robot.time:.1f} s.", flush=True)

    def _events(self) -> Iterator[str]:
        """Yield a line for each new fault and change of mode."""
        robot, log = self._robot, self._robot.fault_injector.log
        for begun, fault in log[self._faults_shown :]:
            who = "" if fault.kind == "unplug" else f" ({fault.drive})"
            yield f"{begun:7.3f} s  fault: {KINDS[fault.kind].text}{who}"
        self._faults_shown = len(log)
        before = self._modes.copy()
        for joint, drive in enumerate(robot.drives):
            mode = drive.machine.mode
            if mode is not before[joint]:
                self._modes[joint] = mode
                why, code = "", drive.machine.fault
                if mode is DriveMode.FAULT:
                    known = [kind(code) for kind in (FaultCode, Notice) if code in set(kind)]
                    why = f": {known[0].name.lower().replace('_', ' ') if known else 'unknown'}"
                yield f"{robot.time:7.3f} s  {JOINTS[joint]}: {_mode_text(drive)}{why}"
        late = self._server.latest(_RECENTLY)
        if late and DriveMode.POSITION in before and DriveMode.POSITION not in self._modes:
            yield (
                f"{robot.time:7.3f} s  this computer was late, by {late * 1e3:.0f} ms: the drives"
                " stood still so long; end other programs, or permit real-time priority (rtprio in"
                " /etc/security/limits.conf)"
            )

    def _status(self, lost: float) -> str:
        robot = self._robot
        parts = [f"{robot.time:7.1f} s"]
        for joint, (name, drive) in enumerate(zip(JOINTS, robot.drives, strict=True)):
            _, _, torque = robot.leg.sensed(joint)
            given = robot.leg.transforms[joint].joint_torque(torque) if drive.active else 0.0
            angle = math.degrees(robot.leg.q[joint])
            parts.append(f"{name} {_mode_text(drive):<12} {angle:+7.1f} deg {given:+6.2f} N m")
        parts.append(f"height {robot.leg.height:.3f} m{' held' if robot.held else ''}")
        if lost > 0.1:
            parts.append(f"{lost:.1f} s lost: the computer is too busy")
        return " | ".join(parts)


def _mode_text(drive: "EmulatedDrive") -> str:
    mode, code = drive.machine.mode, drive.machine.fault
    text = mode.name.lower().replace("_", " ")
    return f"{text} {code}" if code else text
