"""An emulator in a process of its own, for tests and benchmarks.

with EmulatorProcess(EmulatorConfig(robot="legv2")) as emulator:
    drive(emulator.path)
    print(emulator.state().q)
"""

import multiprocessing
from contextlib import AbstractContextManager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import cast

from hopping_leg.deploy.realtime import prefer_this_process, uninterrupted
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.ports import PtyPort
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.emulator.server import EmulatorConfig, Server
from hopping_leg.errors import UsageError
from studies.fault_campaign.wire_log import WireLog

_PATIENCE = 60.0
"""Longest wait for an answer of the process, s; importing takes long on a busy machine."""


@dataclass(frozen=True)
class EmulatorState:
    """The truth about the emulated robot at a time, s, since the start: hip and knee, rad."""

    time: float
    modes: tuple[int, ...]
    q: tuple[float, ...]
    flown: float
    """When the foot left the ground for the first time, s; infinite if it did not yet."""
    faults: tuple[tuple[float, Fault], ...]
    """Those that began, with when, s."""


class EmulatorProcess(AbstractContextManager["EmulatorProcess"]):
    """A running emulator; ``path`` is the terminal that the host opens.

    Raises:
        UsageError: The process did not start; the message says why.
    """

    def __init__(self, start: EmulatorConfig) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(start, theirs), daemon=True)
        self._process.start()
        theirs.close()
        answer = self._answer()
        if not isinstance(answer, Path):
            raise UsageError(f"The emulator did not start: {answer}")
        self.path = answer

    def state(self) -> EmulatorState:
        """Return the truth about the robot now."""
        return cast(EmulatorState, self._ask("state"))

    def log(self) -> WireLog:
        """Return what went over the wire."""
        return cast(WireLog, self._ask("log"))

    def inject(self, fault: Fault) -> None:
        """Let a fault happen; its time counts from now."""
        self._ask(fault)

    def __exit__(self, *_: object) -> None:
        self._pipe.close()
        self._process.join(5)
        self._process.kill()
        self._process.join()

    def _ask(self, request: str | Fault) -> object:
        self._pipe.send(request)
        return self._answer()

    def _answer(self) -> object:
        if not self._pipe.poll(_PATIENCE):
            raise UsageError("The emulator's process does not answer.")
        try:
            return self._pipe.recv()
        except EOFError as error:
            raise UsageError("The emulator's process ended by itself.") from error


def _serve(start: EmulatorConfig, pipe: Connection) -> None:
    """Run in the process: serve the terminal until the pipe is closed."""
    try:
        robot, port = start.build(), PtyPort(start.link)
        log = WireLog()
        robot.on_message, robot.on_mode = log.record, log.record_mode
    except Exception as error:
        pipe.send(str(error))
        return
    server = Server(robot, port)
    pipe.send(port.path)
    prefer_this_process()
    with uninterrupted():
        server.run(lambda: not _answer_parent(pipe, robot, log))
    port.close()


def _answer_parent(pipe: Connection, robot: EmulatedRobot, log: WireLog) -> bool:
    """Answer what the parent asked; return whether it is still there."""
    injector = robot.fault_injector
    try:
        while pipe.poll():
            request = pipe.recv()
            if isinstance(request, Fault):
                injector.add(request)
            if request == "log":
                pipe.send(log)
            else:
                modes = tuple(int(drive.machine.mode) for drive in robot.drives)
                q, faults = tuple(robot.leg.q.tolist()), tuple(injector.log)
                pipe.send(EmulatorState(robot.time, modes, q, injector.flown, faults))
    except (EOFError, OSError):
        return False
    return True
