"""Host and emulated robot in one process on one made-up clock: exact, and as fast as it goes.

The host's own link and loop run unchanged; their clock only moves when the loop waits for its next
tick, and the robot moves with it. Everything that the wire does to a run but its timing is there.
"""

import asyncio
from typing import Any

from moteus import Transport

from hopping_leg.deploy.driver import MoteusLink
from hopping_leg.deploy.emulator.in_process import InProcessDevice
from hopping_leg.deploy.emulator.robot import EmulatedRobot

_PATIENCE = 0.5
"""What an answer that is lost costs, s of the computer's time."""

_STEP_SECONDS = 60.0


class Lockstep:
    """A clock that moves an emulated robot.

    Args:
        robot: Behind the wire.

    Attributes:
        truth: Time and base height at every tick, s and m, and the foot's clearance, m.
    """

    def __init__(self, robot: EmulatedRobot) -> None:
        self.robot = robot
        self.truth: list[tuple[float, float, float]] = []
        self.link = MoteusLink(robot.robot, self._open, self)

    def now(self) -> float:
        """Return the robot's time."""
        return self.robot.time

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline."""
        self.link.call(self._advance(deadline), _STEP_SECONDS)
        leg = self.robot.leg
        self.truth.append((self.robot.time, leg.height, leg.foot_clearance))
        return max(self.robot.time, deadline)

    def patience(self, until: float) -> float:
        """Return how long an answer is waited for: long enough for any computer."""
        return _PATIENCE

    def _open(self) -> Any:  # noqa: ANN401
        return Transport([InProcessDevice(self.robot)])

    async def _advance(self, until: float) -> None:
        """Move once all commands under way have been delivered."""
        while len(asyncio.all_tasks()) > 1:
            await asyncio.sleep(0)
        self.robot.advance(until)
