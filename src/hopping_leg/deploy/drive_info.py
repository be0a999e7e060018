"""What the drives say about themselves, asked one by one before anything is armed."""

import contextlib
import math
from collections.abc import Sequence
from typing import Any

from moteus import multiplex
from moteus.protocol import Register

from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.preflight import DriveInfo, Finding, Setting, required_settings
from hopping_leg.deploy.replies import read_registers, sensor_reading
from hopping_leg.errors import HardwareError
from hopping_leg.robot.parameters import JOINTS

_TRIES = 3
_ANSWER_SECONDS = 1.0  # For a try
_WRITE_SECONDS = 5.0  # For a try of what goes into the permanent memory
_POLL_SECONDS = 0.01
_VERSIONS = (Register.MODEL_NUMBER, Register.FIRMWARE_VERSION, Register.REGISTER_MAP_VERSION)
_IDENTITY = {int(register): multiplex.INT32 for register in _VERSIONS}
_SERIAL = {int(Register.SERIAL_NUMBER) + word: multiplex.INT32 for word in range(3)}
_STATE = {
    int(Register.MODE): multiplex.INT8,
    int(Register.POSITION): multiplex.F32,
    int(Register.HOME_STATE): multiplex.INT8,
    int(Register.VOLTAGE): multiplex.F32,
    int(Register.TEMPERATURE): multiplex.F32,
    int(Register.FAULT): multiplex.INT8,
}


def inspect(link: MoteusLink) -> tuple[DriveInfo, DriveInfo]:
    """Ask both drives everything that arming depends on."""
    return _inspect(link, 0), _inspect(link, 1)


def configure(link: MoteusLink, joint: int, settings: Sequence[Setting]) -> None:
    """Write settings into a stopped drive (0 hip, 1 knee) for good, or raise HardwareError."""
    console = Console(link, joint)
    for command in (*(f"conf set {s.name} {s.text}" for s in settings), "conf write"):
        answer = console.ask(command, _WRITE_SECONDS)
        if answer != "OK":
            raise HardwareError(
                f"The drive of the {JOINTS[joint]} answers '{command}' by '{answer}'; check its"
                " firmware, its power and its wires."
            )


def home(link: MoteusLink, angles: Sequence[float]) -> None:
    """Tell both stopped drives where their joints are; the rotor's own position makes it exact.

    Angles, rad, are of hip and knee, within a twelfth of a turn of the motors' outputs.
    HardwareError says that a drive does not answer.
    """
    for joint, angle in enumerate(angles):
        position = link.transforms[joint].motor_position(angle)
        command = link.controllers[joint].make_set_output_nearest(position=position, query=True)
        if not any(link.ask(command, _ANSWER_SECONDS) for _ in range(_TRIES)):
            raise HardwareError(
                f"The drive of the {JOINTS[joint]} does not answer; check its power and its wires."
            )


def _inspect(link: MoteusLink, joint: int) -> DriveInfo:
    values: dict[int, Any] = {}
    for registers in (_STATE, _IDENTITY, _SERIAL):
        answer = _query(link, joint, registers)
        if not answer:
            return DriveInfo(answers=False)
        values |= answer
    return DriveInfo(
        answers=True,
        firmware=int(values.get(Register.FIRMWARE_VERSION, 0)),
        register_map=int(values.get(Register.REGISTER_MAP_VERSION, 0)),
        serial="".join(f"{int(values.get(word, 0)) & 0xFFFFFFFF:08x}" for word in _SERIAL),
        home=int(values.get(Register.HOME_STATE, 0)),
        position=link.transforms[joint].joint_position(values.get(Register.POSITION, math.nan)),
        mode=int(values.get(Register.MODE, 0)),
        fault=int(values.get(Register.FAULT, 0)),
        voltage=float(values.get(Register.VOLTAGE, math.nan)),
        temperature=float(values.get(Register.TEMPERATURE, math.nan)),
        settings=_settings(link, joint),
    )


def check_height(link: MoteusLink) -> list[Finding]:
    """Check whether the height sensor, if there is one, tells anything within a second."""
    sensor, reading = link.robot.hardware.height, math.nan
    if not sensor.source:
        return []
    joint, until = JOINTS.index(sensor.drive), link.clock.now() + _ANSWER_SECONDS
    while math.isnan(reading) and link.clock.now() < until:
        link.clock.wait_until(link.clock.now() + _POLL_SECONDS)
        values = _query(link, joint, link.controllers[joint].query_resolution._extra)
        reading = link.sensed(sensor_reading(values))
    silent = f"the height sensor ({sensor.source}) gives nothing; check its wires and settings."
    found = f"{sensor.height(reading):.3f} m, reads {reading:.5g}"
    return [Finding(joint, "base height", found, silent if math.isnan(reading) else "")]


def _query(link: MoteusLink, joint: int, registers: dict[int, int]) -> dict[int, Any]:
    """Ask again where no answer comes; nothing after the last try."""
    command = link.controllers[joint].make_custom_query(registers)
    for _ in range(_TRIES):
        answer = link.ask(command, _ANSWER_SECONDS)
        with contextlib.suppress(Exception):  # the answer is damaged, or there is none
            values = read_registers(answer.data if answer else b"")
            if not registers.keys().isdisjoint(values):
                return values
    return {}


def _settings(link: MoteusLink, joint: int) -> dict[str, float]:
    """Return what is required of a drive as it is; NaN where it is no number."""
    console, found = Console(link, joint), dict[str, float]()
    for setting in required_settings(link.robot, joint):
        answer = console.ask(f"conf get {setting.name}", _ANSWER_SECONDS)
        if not answer:  # and so will be the others
            break
        try:
            found[setting.name] = float(answer)
        except ValueError:
            found[setting.name] = math.nan
    return found


class Console:
    """A stopped drive's text console, tunnelled in frames."""

    def __init__(self, link: MoteusLink, joint: int) -> None:
        self._link, self._controller = link, link.controllers[joint]
        self._write("tel stop")

    def ask(self, line: str, seconds: float) -> str:
        """Return the first line that answers a line; empty if none comes in some tries."""
        for _ in range(_TRIES):
            while self._read():
                pass
            self._write(line)
            text, until = b"", self._link.clock.now() + seconds
            while self._link.clock.now() < until:
                new = self._read()
                text += new
                if b"\n" in text:
                    return text.splitlines()[0].decode("latin1").strip()
                if not new:
                    self._link.clock.wait_until(self._link.clock.now() + _POLL_SECONDS)
        return ""

    def _write(self, line: str) -> None:
        data, most = f"{line}\n".encode(), self._controller.max_diagnostic_write
        for begin in range(0, len(data), most):
            piece = data[begin : begin + most]
            self._link.tell(self._controller.make_diagnostic_write(piece))

    def _read(self) -> bytes:
        command = self._controller.make_diagnostic_read()
        answer = self._link.ask(command, _ANSWER_SECONDS)
        return (answer and command.parse(answer).data) or b""
