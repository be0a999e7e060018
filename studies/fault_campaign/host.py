"""Mishaps of the host itself: it stands still, or dies."""

import os
import signal
import threading
import time

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.emulator.drive import EmulatedDrive
from hopping_leg.emulator.leg import TIMESTEP
from hopping_leg.emulator.mode_machine import CONTROLLING
from hopping_leg.emulator.virtual_time import Lockstep

_WATCHED = 0.1
"""How long the drives are watched after the host's death, s."""


class HostDiedError(Exception):
    """The host is dead and the drives have been watched."""


class StruckClock:
    """A lockstep clock of a host that is struck at a time after the first lift-off.

    Args:
        lockstep: That is run.
        at: When, s after the first lift-off.
        stall: How long the host stands still, s.
        dies: Whether it dies: ``HostDiedError`` is raised, and ``braked`` tells the drives' answer.
        killed_after: Time of the computer after which the process is really killed, s; None lets
            it live.

    Attributes:
        began: When it was struck, s.
        braked: From the host's death until both drives brake, s; None if a drive does not.
    """

    def __init__(
        self,
        lockstep: Lockstep,
        at: float,
        *,
        stall: float = 0.0,
        dies: bool = False,
        killed_after: float | None = None,
    ) -> None:
        self._lockstep, self._at = lockstep, at
        self._stall, self._dies, self._killed_after = stall, dies, killed_after
        self.began: float | None = None
        self.braked: float | None = None

    def now(self) -> float:
        """Return the robot's time."""
        return self._lockstep.now()

    def patience(self, until: float) -> float:
        """Return the time that is left, s."""
        return self._lockstep.patience(until)

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline, unless the host is struck.

        Raises:
            HostDiedError: It died.
        """
        robot = self._lockstep.robot
        struck = self._stall or self._dies or self._killed_after is not None
        if struck and self.began is None and deadline >= robot.fault_injector.flown + self._at:
            self.began = robot.time
            if self._killed_after is not None:
                threading.Thread(target=_kill, args=(self._killed_after,), daemon=True).start()
            if self._dies:
                self.braked = self._watch()
                raise HostDiedError
            deadline += self._stall
        return self._lockstep.wait_until(deadline)

    def _watch(self) -> float | None:
        """Let the robot move without a host; return when both drives have begun to brake."""
        robot = self._lockstep.robot
        begin = robot.time
        braked = None
        while robot.time < begin + _WATCHED:
            if braked is None and all(_braking(drive) for drive in robot.drives):
                braked = robot.time - begin
            robot.advance(robot.time + TIMESTEP)
        return braked


def _braking(drive: EmulatedDrive) -> bool:
    """Whether a drive brakes by itself, or has no power on its windings."""
    machine, settings = drive.machine, drive.settings
    if machine.mode is DriveMode.TIMEOUT:
        return int(settings["servo.timeout_mode"]) == DriveMode.BRAKE
    return machine.mode is DriveMode.BRAKE or machine.mode not in CONTROLLING


def _kill(seconds: float) -> None:
    time.sleep(seconds)
    os.kill(os.getpid(), signal.SIGKILL)
