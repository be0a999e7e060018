"""Emulate a leg with its two drives behind a real wire, for `hop deploy` and `hop doctor`.

The emulator offers a serial terminal which the moteus client takes for an fdcanusb, or a CAN bus of
python-can. Behind it two drives, with their own mode machines, watchdogs and limits, turn the
simulated leg in real time. Ends with Ctrl-C.

Examples:
  hop emulate --robot legv2
  hop deploy fast --transport /dev/pts/5        # in another terminal, with the path printed here
  hop emulate --robot twin --faults faults.toml --link /tmp/leg
  hop emulate --interface udp_multicast
  hop emulate --no-homed --no-configured        # as a leg that was just put together

A fault script is TOML; `hop emulate --kinds` lists what it may name:
  [[fault]]
  kind = "late_reply"
  since = "flight"
  at = 2.0
  drive = "knee"
  value = 0.012
"""

import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Literal

from rich.console import Console
from rich.table import Table

from hopping_leg.deploy.emulator.faults import KINDS, load_faults
from hopping_leg.deploy.emulator.pty_port import PtyPort
from hopping_leg.deploy.emulator.robot import EmulatedRobot
from hopping_leg.deploy.emulator.server import Port, Server
from hopping_leg.deploy.emulator.start import Start
from hopping_leg.deploy.emulator.status import Events, status_line
from hopping_leg.deploy.realtime import prefer_this_thread, uninterrupted
from hopping_leg.errors import UsageError

_RENEWED = 0.2
"""How often the status line is renewed, s."""


@dataclass(frozen=True)
class Emulate:
    """What is emulated and how the host reaches it."""

    robot: str = "legv2"
    """A shipped robot or a .toml file; its [reality] stands behind the wire, too."""
    start_pose: str = "stand"
    """stand, crouch, stretch, zero (straight down), or joint angles as HIP,KNEE in rad."""
    faults: Path | None = None
    """TOML script of what goes wrong, and when."""
    interface: Literal["pty", "udp_multicast", "socketcan"] = "pty"
    """pty is a serial terminal like an fdcanusb's; the others are buses of python-can."""
    channel: str | None = None
    """Of a CAN bus: multicast group or interface name; default 239.74.163.2 or vcan0."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""
    configured: bool = True
    """Drives configured as the robot's file asks; else as their firmware is delivered."""
    homed: bool = True
    """Drives homed by hand; else they know their position within a turn of the rotor only."""
    held: bool = True
    """Somebody holds the leg until both drives are powered."""
    seed: int = 0
    """Of sensor noise and jitter."""
    realtime: bool = True
    """Take real-time priority where that is permitted, so that the drives answer in time."""
    seconds: float | None = None
    """End by itself after this time; default: with Ctrl-C."""
    kinds: bool = False
    """List the kinds of faults and end."""


def run(args: Emulate) -> None:
    """Serve the emulated robot until Ctrl-C."""
    console = Console(highlight=False)
    if args.kinds:
        _list_kinds(console)
        return
    if args.seed < 0:
        raise UsageError(f"A seed of {args.seed} has no meaning; give 0 or more.")
    start = Start(
        robot=args.robot,
        pose=args.start_pose,
        configured=args.configured,
        homed=args.homed,
        held=args.held,
        seed=args.seed,
        faults=() if args.faults is None else load_faults(args.faults),
        interface=args.interface,
        channel=args.channel,
        link=args.link,
    )
    robot, port = start.build(), start.open()
    try:
        with _ending_signals() as over:
            _greet(console, robot, port)
            if args.realtime and prefer_this_thread() is not None:
                console.print("Without real-time priority the drives may answer late under load.")
            _serve(robot, port, lambda: bool(over) or _is_over(robot, args.seconds))
    finally:
        port.close()


def _is_over(robot: EmulatedRobot, seconds: float | None) -> bool:
    return seconds is not None and robot.time >= seconds


@contextmanager
def _ending_signals() -> Iterator[list[int]]:
    """Yield what fills with the signals that ask for the end: that is no error."""
    over: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        over.append(number)

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield over
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _greet(console: Console, robot: EmulatedRobot, port: Port) -> None:
    ids = " and ".join(str(drive.id) for drive in robot.drives)
    if isinstance(port, PtyPort):
        console.print(f"Drives {ids} of {robot.robot.name} behind {port.path}", soft_wrap=True)
        console.print(f"  hop deploy fast --transport {port.path}", soft_wrap=True)
    else:
        console.print(f"Drives {ids} of {robot.robot.name} on {port}.")
        console.print(f"  hop deploy fast --transport {port}")
    sys.stdout.flush()


def _serve(robot: EmulatedRobot, port: Port, is_over: Callable[[], bool]) -> None:
    """Serve until it is over, and tell what happens."""
    display = _Display(robot)
    server = Server(robot, port)
    server.on_turn = lambda: display.renew(server.lost)
    try:
        with uninterrupted():
            server.run(is_over)
    finally:
        display.end()


class _Display:
    """Events on lines of their own; the state on a line that is renewed, on a terminal only."""

    def __init__(self, robot: EmulatedRobot) -> None:
        self._robot, self._events = robot, Events(robot)
        self._live = sys.stdout.isatty()
        self._due = time.monotonic()

    def renew(self, lost: float) -> None:
        """Show what is new."""
        clear = "\r\x1b[K" if self._live else ""
        for line in self._events.news():
            print(f"{clear}{line}", flush=True)
        if self._live and time.monotonic() >= self._due:
            self._due = time.monotonic() + _RENEWED
            print(f"{clear}{status_line(self._robot, lost)}", end="", flush=True)

    def end(self) -> None:
        """Leave the line."""
        if self._live:
            print()
        print(f"The emulator ended after {self._robot.time:.1f} s.", flush=True)


def _list_kinds(console: Console) -> None:
    table = Table("kind", "what happens", "value", "unit", "lasts")
    for name, kind in KINDS.items():
        if math.isnan(kind.duration):
            lasts = "so many replies"
        else:
            lasts = "on" if math.isinf(kind.duration) else f"{kind.duration:g} s"
        table.add_row(name, kind.text, f"{kind.value:g}" if kind.unit else "", kind.unit, lasts)
    console.print(table)
