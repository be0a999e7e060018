"""Host and emulated robot in one process in virtual time: exact, and as fast as it goes.

The host's own loop, link and client run unchanged, down to the bytes on a terminal; the robot moves
whenever they wait. Everything that the wire does to a run but the computer's own delays is there.
"""

from collections.abc import Callable
from typing import Any

from moteus import Transport

from hopping_leg.deploy.driver import MoteusLink
from hopping_leg.deploy.fdcanusb import TolerantFdcanusb
from hopping_leg.emulator.pty_port import PtyPort
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.emulator.virtual_time import SteppedClient

WIRE_TIME = 5e-4
"""Time from a question to its answer, s, as measured with two motors on an fdcanusb."""


class Lockstep:
    """A clock that moves an emulated robot, and the link to it.

    Args:
        robot: Behind the wire.
        checksums: Whether the lines have checksums; a plain fdcanusb's have none.

    Attributes:
        truth: Time and base height at every tick, s and m, and the foot's clearance, m.
    """

    def __init__(self, robot: EmulatedRobot, *, checksums: bool = True) -> None:
        self.robot = robot
        robot.wire_time = WIRE_TIME
        self.truth: list[tuple[float, float, float]] = []
        self._port, self._checksums = PtyPort(), checksums
        self.link = MoteusLink(robot.robot, self._open, self, self._make_client)

    def now(self) -> float:
        """Return the robot's time."""
        return self.robot.time

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline."""
        self._client.wait(deadline)
        leg = self.robot.leg
        self.truth.append((self.robot.time, leg.height, leg.foot_clearance))
        return max(self.robot.time, deadline)

    def patience(self, until: float) -> float:
        """Return the time that is left, s: none once the client has done its work."""
        return max(until - self.robot.time, 0.0)

    def _make_client(self, on_error: Callable[[str], None]) -> SteppedClient:
        self._client = SteppedClient(self.robot, self._port, on_error)
        return self._client

    def _open(self) -> Any:  # noqa: ANN401
        device = TolerantFdcanusb(str(self._port.path))
        if not self._checksums:
            device._is_fdcanusb, device._checksum_active = True, False
        return Transport([device])
