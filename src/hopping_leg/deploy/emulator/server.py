"""The emulated robot in real time behind a pseudo-terminal that passes for an fdcanusb.

One thread does all: it waits for bytes from the host or for the next step, lets the robot catch up
with the clock, and answers.
"""

import os
import select
import termios
import time
import tty
from collections.abc import Callable
from pathlib import Path

from hopping_leg.deploy.emulator.frames import Frame
from hopping_leg.deploy.emulator.line_protocol import LineProtocol, received_line
from hopping_leg.deploy.emulator.robot import EmulatedRobot

_IDLE = 0.002
"""Longest sleep between two looks at the clock, s."""

_FURTHEST = 0.02
"""Most that is caught up with at once after the process was held off, s; the rest is lost."""


class PtyPort:
    """A pseudo-terminal; the host opens ``path``."""

    def __init__(self, link: Path | None = None) -> None:
        self._master, self._slave = os.openpty()
        for descriptor in (self._master, self._slave):
            tty.setraw(descriptor, termios.TCSANOW)
        os.set_blocking(self._master, False)
        self.path = Path(os.ttyname(self._slave))
        self.protocol = LineProtocol()
        self._link = link
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(self.path)

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._master

    def receive(self) -> list[Frame | bytes]:
        """Return what the host sent: frames, and answers that its lines call for."""
        try:
            return self.protocol.feed(os.read(self._master, 65536))
        except BlockingIOError:
            return []

    def send(self, data: bytes) -> None:
        """Send bytes; a host that does not read loses them."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            return

    def send_frame(self, frame: Frame) -> None:
        """Send a frame as a line."""
        self.send(self.protocol.line(received_line(frame)))

    def close(self) -> None:
        """Take the terminal away, as when a plug is pulled."""
        os.close(self._master)
        os.close(self._slave)
        if self._link is not None:
            self._link.unlink(missing_ok=True)


class Server:
    """Runs an emulated robot behind a port.

    Args:
        robot: Behind the wire.
        port: Towards the host.
        on_idle: Called every few milliseconds, e.g. to show the state.
    """

    def __init__(
        self,
        robot: EmulatedRobot,
        port: PtyPort,
        on_idle: Callable[[], None] = lambda: None,
    ) -> None:
        self.robot, self.port, self._on_idle = robot, port, on_idle
        self.lost = 0.0
        """Time that was not simulated as the process did not get the processor, s."""
        self._offset = time.monotonic() - robot.time

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop`` says so."""
        while not stop():
            self.turn()

    def turn(self) -> None:
        """Wait for the host or the clock, then do what is due."""
        ready, _, _ = select.select([self.port], [], [], _IDLE)
        self._catch_up()
        if ready:
            for item in self.port.receive():
                if isinstance(item, bytes):
                    self.port.send(item)
                    continue
                for answer in self.robot.receive(item):
                    self.port.send_frame(answer)
        self._on_idle()

    def _catch_up(self) -> None:
        now = time.monotonic() - self._offset
        behind = now - self.robot.time
        if behind > _FURTHEST:
            self._offset += behind - _FURTHEST
            self.lost += behind - _FURTHEST
            now -= behind - _FURTHEST
        self.robot.advance(now)
