"""What went over the wire: every command of the host, every answer of a drive, every change.

It tells, independently of what the host believes, whether anything unsafe was commanded and how
soon after a bad answer the host reacted. Times are in s; joint 0 is the hip, 1 the knee.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from moteus.protocol import Register, parse_reply

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.frames import Frame
from hopping_leg.emulator import bus, mode_machine


@dataclass(frozen=True, slots=True)
class CommandEvent:
    """A command that wrote a drive's mode: feedforward and its largest torque, N m at the motor."""

    time: float
    joint: int
    mode: DriveMode
    torque: float
    most: float


@dataclass(frozen=True, slots=True)
class ReplyEvent:
    """The state that a drive's answer tells, rounded as it travels; V and degrees C."""

    time: float
    joint: int
    mode: DriveMode
    voltage: float
    temperature: float


_TOLD = (Register.MODE, Register.VOLTAGE, Register.TEMPERATURE)
"""Registers of an answer that is noted."""
_REMEMBERED = 100_000  # Commands and answers each, about a minute's


class WireLog:
    """Commands that wrote a mode, answers, changes of mode; the oldest are forgotten."""

    def __init__(self) -> None:
        self.commands: deque[CommandEvent] = deque(maxlen=_REMEMBERED)
        self._replies: deque[tuple[float, int, bytes]] = deque(maxlen=_REMEMBERED)
        self.changes: deque[tuple[float, int, DriveMode]] = deque(maxlen=_REMEMBERED)
        self._modes = [DriveMode.STOPPED, DriveMode.STOPPED]

    def record(self, time: float, joint: int, message: bus.Message, answer: Frame | None) -> None:
        """Note what the host sent to a drive, if it wrote the drive's mode, and the answer."""
        if answer is not None:
            self._replies.append((time, joint, answer.data))
        written = {s.register: s.value or 0.0 for s in message.writes}
        if written.get(Register.MODE) in mode_machine.MODES:
            mode = DriveMode(int(written[Register.MODE]))
            torque = float(written.get(Register.COMMAND_FEEDFORWARD_TORQUE, 0.0))
            most = float(written.get(Register.COMMAND_POSITION_MAX_TORQUE, 0.0))
            self.commands.append(CommandEvent(time, joint, mode, torque, most))

    def answers(self, since: float = 0.0) -> Iterator[ReplyEvent]:
        """Yield the answers that told a drive's state, from a time on, s."""
        for time, joint, data in self._replies:
            if time < since:
                continue
            values = parse_reply(data)
            if values.keys() >= set(_TOLD):
                mode, voltage, temperature = (values[register] for register in _TOLD)
                yield ReplyEvent(time, joint, DriveMode(int(mode)), voltage, temperature)

    def record_mode(self, time: float, joint: int, mode: DriveMode) -> None:
        """Note a drive's mode after a step, if it is another."""
        if mode is not self._modes[joint]:
            self._modes[joint] = mode
            self.changes.append((time, joint, mode))
