"""Host and emulated robot in one process in virtual time: exact, and as fast as it goes.

An event loop that has nothing to do does not sleep: it lets the emulated robot move until something
arrives or the next timer is due. The host's loop, link and client run unchanged, down to the bytes
on a terminal.
"""

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from moteus import Transport

from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.transport import TolerantFdcanusb
from hopping_leg.emulator import ports, server
from hopping_leg.emulator.leg import TIMESTEP
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.errors import HardwareError

Result = TypeVar("Result")

_BUSY = 20  # Rounds that a busy loop may go without a look at the line
_WIRE_TIME = 5e-4
"""Time from a question to its answer, s, as measured with two motors on an fdcanusb."""

_FOREVER = 60.0  # Virtual time after which nobody waits for anything any more, s


class VirtualTime(asyncio.SelectorEventLoop):
    """An event loop whose time is the emulated robot's."""

    def __init__(self, robot: EmulatedRobot, port: ports.Port) -> None:
        super().__init__(_Waiting(robot, port))
        self._robot = robot

    def time(self) -> float:
        """Return the robot's time, s."""
        return self._robot.time


class _Waiting(selectors.SelectSelector):
    """Lets the robot move instead of waiting."""

    def __init__(self, robot: EmulatedRobot, port: ports.Port) -> None:
        super().__init__()
        self._robot, self._port, self._busy = robot, port, 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now or becomes ready within a virtual timeout, s."""
        if timeout is not None and timeout <= 0 and self._busy < _BUSY:
            self._busy += 1  # the loop has other work, and no time passes meanwhile
            return []
        self._busy = 0
        robot = self._robot
        until = robot.time + (_FOREVER if timeout is None else timeout)
        server.serve(robot, self._port, ready=True)
        ready = super().select(0)
        while not ready and robot.time < until - 1e-9:
            robot.advance(robot.time + TIMESTEP)
            if server.serve(robot, self._port, ready=False):
                ready = super().select(0)
        return ready


class Lockstep:
    """The clock that moves an emulated robot, the link to it, and the client behind the link.

    Whoever asks the client does its work, in the place of a thread. The lines have checksums, or
    none as a plain fdcanusb's.

    Attributes:
        truth: Time and base height at every tick, s and m, and the foot's clearance, m.
    """

    def __init__(self, robot: EmulatedRobot, *, checksums: bool = True) -> None:
        self.robot, robot.wire_time = robot, _WIRE_TIME
        self.truth: list[tuple[float, float, float]] = []
        self._port, self._checksums = ports.PtyPort(), checksums
        self.loop = VirtualTime(robot, self._port)
        self.link = MoteusLink(robot.robot, self._open, self, self._as_client)

    def now(self) -> float:
        """Return the robot's time."""
        return self.robot.time

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline."""
        if deadline > self.robot.time:
            self.loop.run_until_complete(asyncio.sleep(deadline - self.robot.time))
        leg = self.robot.leg
        self.truth.append((self.robot.time, leg.height, leg.foot_clearance))
        return max(self.robot.time, deadline)

    def patience(self, until: float) -> float:
        """Return the time that is left, s: none once the client has done its work."""
        return max(until - self.robot.time, 0.0)

    def start_soon(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Do work now, until it is done."""
        self.loop.run_until_complete(work())

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do work and return its result.

        Raises:
            HardwareError: It took too long.
        """
        try:
            return self.loop.run_until_complete(asyncio.wait_for(work, seconds))
        except TimeoutError as error:
            raise HardwareError(f"The adapter did not answer within {seconds:g} s.") from error

    def close(self) -> None:
        """End all that is under way, and take the port away."""
        for task in asyncio.all_tasks(self.loop):
            task.cancel()
        self.loop.run_until_complete(asyncio.sleep(0))
        self.loop.close()
        if self._port.plugged:
            self._port.close()

    def _as_client(self, on_error: Callable[[str], None]) -> "Lockstep":
        self.loop.set_exception_handler(
            lambda _, context: on_error(str(context.get("exception") or context["message"]))
        )
        return self

    def _open(self) -> Any:  # noqa: ANN401
        device = TolerantFdcanusb(str(self._port.path))
        if not self._checksums:
            device._is_fdcanusb, device._checksum_active = True, False
        return Transport([device])
