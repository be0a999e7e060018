"""What the drives say about themselves, asked one by one before anything is armed."""

import asyncio
import contextlib
import math
from collections.abc import Sequence
from typing import Any

from moteus import CommandError, Stream, multiplex
from moteus.protocol import Register

from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.preflight import DriveInfo, Setting, required_settings

_ANSWER_SECONDS, _TALK_SECONDS, _ALL_SECONDS = 1.0, 5.0, 30.0
_TRIES = 3
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
    """Ask both drives everything that arming depends on.

    Raises:
        HardwareError: The adapter does not answer.
    """
    hip, knee = (link.call(_inspect(link, joint), _ALL_SECONDS) for joint in (0, 1))
    return hip, knee


def configure(link: MoteusLink, joint: int, settings: Sequence[Setting]) -> None:
    """Write settings into a stopped drive (0 hip, 1 knee), and into its permanent memory.

    Raises:
        HardwareError: The drive does not answer.
    """
    link.call(_configure(link, joint, settings), _ALL_SECONDS)


def home(link: MoteusLink, angles: Sequence[float]) -> None:
    """Tell both stopped drives where their joints are; the rotor's own position makes it exact.

    Angles, rad, are of hip and knee, within a twelfth of a turn of the motors' outputs.

    Raises:
        HardwareError: A drive does not answer.
    """
    for joint, angle in enumerate(angles):
        position = link.transforms[joint].motor_position(angle)
        work = link.controllers[joint].set_output_nearest(position=position, query=True)
        link.call(asyncio.wait_for(work, _ANSWER_SECONDS), _TALK_SECONDS)


async def _inspect(link: MoteusLink, joint: int) -> DriveInfo:
    values: dict[int, Any] = {}
    for registers in (_STATE, _IDENTITY, _SERIAL):
        answer = await _query(link.controllers[joint], registers)
        if answer is None:
            return DriveInfo(answers=False)
        values |= answer
    stream = await _console(link, joint)
    names = [setting.name for setting in required_settings(link.robot, joint)]
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
        settings={name: await _setting(stream, name) for name in names},
    )


async def _query(controller: Any, registers: dict[int, int]) -> dict[int, Any] | None:  # noqa: ANN401
    """Ask again where no answer comes; None after the last try."""
    for _ in range(_TRIES):
        with contextlib.suppress(TimeoutError, RuntimeError):
            answer = await asyncio.wait_for(controller.custom_query(registers), _ANSWER_SECONDS)
            if answer is not None:
                return dict(answer.values)
    return None


async def _console(link: MoteusLink, joint: int) -> Any:  # noqa: ANN401
    """Return the drive's console with nothing left in it."""
    stream = Stream(link.controllers[joint])
    await asyncio.wait_for(stream.write_message(b"tel stop"), _ANSWER_SECONDS)
    await stream.flush_read()
    return stream


async def _setting(stream: Any, name: str) -> float:  # noqa: ANN401
    try:
        work = stream.command(f"conf get {name}".encode(), allow_any_response=True)
        return float(await asyncio.wait_for(work, _ANSWER_SECONDS))
    except (ValueError, TimeoutError, CommandError):
        return math.nan


async def _configure(link: MoteusLink, joint: int, settings: Sequence[Setting]) -> None:
    stream = await _console(link, joint)
    commands = [f"conf set {setting.name} {setting.text}" for setting in settings]
    for command in (*commands, "conf write"):
        await asyncio.wait_for(stream.command(command.encode()), _TALK_SECONDS)
