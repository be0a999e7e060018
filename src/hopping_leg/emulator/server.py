"""The emulated robot in real time behind a port.

One thread does all: it waits for the host, the next step or the next reply, lets the robot catch up
with the clock, and answers.
"""

import select
import time
from collections.abc import Callable
from typing import Protocol

from hopping_leg.emulator.frames import Frame
from hopping_leg.emulator.reply_queue import QueuedReply
from hopping_leg.emulator.robot import EmulatedRobot

_IDLE = 0.001
"""Longest sleep between two looks at the clock, s."""

_FURTHEST = 0.02
"""Most that is caught up with at once after the process was held off, s; the rest is lost."""


class Port(Protocol):
    """The adapter between host and drives."""

    @property
    def plugged(self) -> bool:
        """Whether the host can reach it."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        ...

    def receive(self) -> list[Frame]:
        """Return frames that the host sent."""
        ...

    def send(self, item: QueuedReply) -> None:
        """Send to the host."""
        ...

    def plug_in(self) -> None:
        """Come back."""
        ...

    def unplug(self) -> None:
        """Be gone for the host."""
        ...

    def close(self) -> None:
        """End."""
        ...


class Server:
    """Runs an emulated robot behind a port.

    Args:
        robot: Behind the wire.
        port: Towards the host.
    """

    def __init__(self, robot: EmulatedRobot, port: Port) -> None:
        self.robot, self.port = robot, port
        self.on_turn: Callable[[], None] = lambda: None
        """Called every few milliseconds, e.g. to show the state."""
        self.lost = 0.0
        """Time that was not simulated as the process did not get the processor, s."""
        self._offset = time.monotonic() - robot.time

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop`` says so."""
        while not stop():
            self.turn()

    def turn(self) -> None:
        """Wait for the host or the clock, then do what is due."""
        waiting = [self.port] if self.port.plugged else []
        ready, _, _ = select.select(waiting, [], [], self._patience())
        self._catch_up()
        serve(self.robot, self.port, ready=bool(ready))
        self.on_turn()

    def _patience(self) -> float:
        due = self.robot.reply_queue.next_due()
        return _IDLE if due is None else min(max(due - self.robot.time, 0.0), _IDLE)

    def _catch_up(self) -> None:
        now = time.monotonic() - self._offset
        behind = now - self.robot.time
        if behind > _FURTHEST:
            self._offset += behind - _FURTHEST
            self.lost += behind - _FURTHEST
            now -= behind - _FURTHEST
        self.robot.advance(now)


def serve(robot: EmulatedRobot, port: Port, *, ready: bool) -> bool:
    """Hand over what is due between host and robot, and pull or push the plug.

    Args:
        robot: Behind the wire.
        port: Towards the host.
        ready: Whether the host may have sent something.

    Returns:
        Whether there is anything new for the host.
    """
    if ready and port.plugged:
        for frame in port.receive():
            robot.receive(frame)
    items = robot.reply_queue.take(robot.time)
    for item in items:
        if port.plugged:
            port.send(item)
    plugged = robot.fault_injector.plugged
    if plugged == port.plugged:
        return bool(items)
    if plugged:
        port.plug_in()
    else:
        port.unplug()
    return True
