"""Serve an emulated leg on a terminal, tell what happens; needs the drives' client library."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from rich.console import Console

from hopping_leg.cli.emulate import Emulate
from hopping_leg.deploy.realtime import prefer_this_thread, uninterrupted
from hopping_leg.emulator.faults import load_faults
from hopping_leg.emulator.pty_port import PtyPort
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.emulator.server import Port, Server
from hopping_leg.emulator.start import Start
from hopping_leg.emulator.status import Events, status_line

_RENEWED = 0.2
"""How often the status line is renewed, s."""


def emulate(args: Emulate, console: Console) -> None:
    """Serve the emulated robot until it is over.

    Args:
        args: What is emulated.
        console: For what is said before.
    """
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
