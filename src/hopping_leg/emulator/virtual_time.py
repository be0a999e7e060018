"""Host and emulated robot in one process in virtual time: exact, and as fast as it goes.

Who waits, for a time or for bytes, lets the emulated robot move instead. The host's loop, link and
adapter run unchanged, down to the bytes on the line.
"""

import os
import select
import socket
from collections.abc import Sequence

from hopping_leg.deploy.fdcanusb import LineTransport
from hopping_leg.deploy.frames import Frame
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.emulator import ports, server
from hopping_leg.emulator.leg import TIMESTEP
from hopping_leg.emulator.robot import EmulatedRobot

_WIRE_TIME = 5e-4
"""Time from a question to its answer, s, as measured with two motors on an fdcanusb."""


class Lockstep:
    """The clock that moves an emulated robot, and the link to it.

    The lines have checksums, or none as a plain fdcanusb's. ``truth`` is time, s, base height and
    the foot's clearance, m, and the angles of hip and knee, rad, at every tick.
    """

    def __init__(self, robot: EmulatedRobot, *, checksums: bool = True) -> None:
        self.robot, robot.wire_time = robot, _WIRE_TIME
        self.truth: list[tuple[float, ...]] = []
        self._port = _Pair()
        server.serve(robot, self._port, ready=False)
        self.link = MoteusLink(robot.robot, _Host(self, self._port, checksums), self)

    def now(self) -> float:
        """Return the robot's time."""
        return self.robot.time

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline."""
        while self.robot.time < deadline - 1e-9:
            self.step()
        leg = self.robot.leg
        self.truth.append((self.robot.time, leg.height, leg.foot_clearance, *leg.q.tolist()))
        return max(self.robot.time, deadline)

    def wait_readable(self, descriptor: int, until: float) -> bool:
        """Let the robot move until a descriptor can be read, or a time; return whether it can."""
        while not (readable := select.select([descriptor], [], [], 0)[0]):
            if self.robot.time >= until - 1e-9:
                return False
            self.step()
        return bool(readable)

    def step(self) -> None:
        """Let the robot take a step, and deliver what is due by then."""
        self.robot.advance(self.robot.time + TIMESTEP)
        server.serve(self.robot, self._port, ready=False)


class _Pair(ports.LinePort):
    """A serial line within the process; ``host`` is what the host's end is a duplicate of."""

    def plug_in(self) -> None:
        ours, self.host = (end.detach() for end in socket.socketpair())
        for end in (ours, self.host):
            os.set_blocking(end, False)
        self.connect(ours)

    def unplug(self) -> None:
        super().unplug()
        os.close(self.host)


class _Host(LineTransport):
    """The host's end of the line: what is sent arrives at once."""

    def __init__(self, lockstep: Lockstep, port: _Pair, checksums: bool) -> None:
        super().__init__(os.dup(port.host), checksums=checksums, wait=lockstep.wait_readable)
        self._robot, self._end = lockstep.robot, port

    def send(self, frames: Sequence[Frame]) -> None:
        super().send(frames)
        server.serve(self._robot, self._end, ready=True)

    def close(self) -> None:
        super().close()
        self._end.close()
