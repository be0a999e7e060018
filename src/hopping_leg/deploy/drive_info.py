"""What the drives say about themselves, asked one by one before anything is armed."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, TypeVar

from moteus import CommandError, Stream, multiplex
from moteus.protocol import Register

from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.preflight import DriveInfo, Setting, required_settings
from hopping_leg.robot.parameters import JOINTS

_ANSWER_SECONDS = 1.0
_TRIES = 3
_TALK_SECONDS = 5.0
_ALL_SECONDS = 60.0

_IDENTITY = {
    int(Register.MODEL_NUMBER): multiplex.INT32,
    int(Register.FIRMWARE_VERSION): multiplex.INT32,
    int(Register.REGISTER_MAP_VERSION): multiplex.INT32,
}
_SERIAL = {int(Register.SERIAL_NUMBER) + word: multiplex.INT32 for word in range(3)}
_STATE = {
    int(Register.MODE): multiplex.INT8,
    int(Register.POSITION): multiplex.F32,
    int(Register.HOME_STATE): multiplex.INT8,
    int(Register.VOLTAGE): multiplex.F32,
    int(Register.TEMPERATURE): multiplex.F32,
    int(Register.FAULT): multiplex.INT8,
}

Result = TypeVar("Result")


def inspect(link: MoteusLink) -> tuple[DriveInfo, DriveInfo]:
    """Ask both drives everything that arming depends on.

    Raises:
        HardwareError: The adapter does not answer.
    """
    hip, knee = link.call(_inspect_both(link), _ALL_SECONDS)
    return hip, knee


def configure(link: MoteusLink, joint: int, settings: Sequence[Setting]) -> None:
    """Write settings into a drive, and into its permanent memory.

    Args:
        link: To the drives; they must be stopped.
        joint: 0 for the hip, 1 for the knee.
        settings: To be written.

    Raises:
        HardwareError: The drive does not answer.
    """
    link.call(_configure(link, joint, settings), _ALL_SECONDS)


def home(link: MoteusLink, angles: Sequence[float]) -> None:
    """Tell both drives where their joints are; the rotor's own position makes it exact.

    Args:
        link: To the drives; they must be stopped.
        angles: Hip and knee, rad, within a twelfth of a turn of the motors' outputs.

    Raises:
        HardwareError: A drive does not answer.
    """
    for joint, angle in enumerate(angles):
        position = link.transforms[joint].motor_position(angle)
        controller = link.controllers[joint]
        work = controller.set_output_nearest(position=position, query=True)
        link.call(asyncio.wait_for(work, _ANSWER_SECONDS), _TALK_SECONDS)


async def _inspect_both(link: MoteusLink) -> list[DriveInfo]:
    return [await _inspect(link, joint) for joint in range(len(JOINTS))]


async def _inspect(link: MoteusLink, joint: int) -> DriveInfo:
    controller = link.controllers[joint]
    state = await _asked(lambda: controller.custom_query(_STATE))
    if state is None:
        return DriveInfo(answers=False)
    identity = await _asked(lambda: controller.custom_query(_IDENTITY))
    serial = await _asked(lambda: controller.custom_query(_SERIAL))
    if identity is None or serial is None:
        return DriveInfo(answers=False)
    state, identity = state.values, identity.values
    words = [int(serial.values.get(register, 0)) & 0xFFFFFFFF for register in _SERIAL]
    return DriveInfo(
        answers=True,
        firmware=int(identity.get(Register.FIRMWARE_VERSION, 0)),
        register_map=int(identity.get(Register.REGISTER_MAP_VERSION, 0)),
        serial="".join(f"{word:08x}" for word in words),
        home=int(state.get(Register.HOME_STATE, 0)),
        position=link.transforms[joint].joint_position(state.get(Register.POSITION, math.nan)),
        mode=int(state.get(Register.MODE, 0)),
        fault=int(state.get(Register.FAULT, 0)),
        voltage=float(state.get(Register.VOLTAGE, math.nan)),
        temperature=float(state.get(Register.TEMPERATURE, math.nan)),
        settings=await _settings(link, joint),
    )


async def _settings(link: MoteusLink, joint: int) -> dict[str, float]:
    stream = await _console(link, joint)
    return {
        setting.name: await _setting(stream, setting.name)
        for setting in required_settings(link.robot, joint)
    }


async def _console(link: MoteusLink, joint: int) -> Any:  # noqa: ANN401
    """Return the drive's console with nothing left in it."""
    stream = Stream(link.controllers[joint])
    await asyncio.wait_for(stream.write_message(b"tel stop"), _ANSWER_SECONDS)
    await stream.flush_read()
    return stream


async def _setting(stream: Any, name: str) -> float:  # noqa: ANN401
    question = f"conf get {name}".encode()
    try:
        work = stream.command(question, allow_any_response=True)
        return float(await asyncio.wait_for(work, _ANSWER_SECONDS))
    except (ValueError, TimeoutError, CommandError):
        return math.nan


async def _configure(link: MoteusLink, joint: int, settings: Sequence[Setting]) -> None:
    stream = await _console(link, joint)
    commands = [f"conf set {setting.name} {setting.text}" for setting in settings]
    for command in (*commands, "conf write"):
        await asyncio.wait_for(stream.command(command.encode()), _TALK_SECONDS)


async def _asked(question: Callable[[], Awaitable[Result]]) -> Result | None:
    """Ask again where no answer comes; None after the last try."""
    for _ in range(_TRIES):
        try:
            answer = await asyncio.wait_for(question(), _ANSWER_SECONDS)
        except (TimeoutError, RuntimeError):
            continue
        if answer is not None:
            return answer
    return None
