"""Both drives through the ``moteus`` client: a ``DriveLink`` in pure torque mode.

The client waits for a lost reply without bound, loses the healthy drive's reply when it is
cancelled, and takes late replies as fresh. Here its event loop has a thread of its own, so that
nothing it does can hang the control loop; frames are judged as they arrive, so that whatever came
in time counts; and what is not done by its deadline is cancelled.
"""

import asyncio
import concurrent.futures
import functools
import math
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Protocol, TypeVar

from moteus import Controller, QueryResolution, multiplex
from moteus.protocol import Register

from hopping_leg.deploy import drive_link, realtime, replies, transport
from hopping_leg.errors import HardwareError
from hopping_leg.robot.parameters import Robot

_SEND_SECONDS = 0.004  # A command that could not leave within this time is dropped: it is outdated
_OPENING_SECONDS = 10.0
_NO_POSITION_CONTROL = {"position": math.nan, "velocity": 0.0} | dict.fromkeys(
    ("kp_scale", "kd_scale", "ilimit_scale"), 0.0
)

Result = TypeVar("Result")


class Client(Protocol):
    """Where the asyncio client's work is done; raises ``HardwareError`` where it takes too long."""

    def start_soon(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Begin work; never waits for the motors."""

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do work and wait for its result."""

    def close(self) -> None:
        """End it."""


class ClientThread:
    """Runs an event loop; work is handed over and never waited for without a deadline."""

    def __init__(self, on_error: Callable[[str], None]) -> None:
        self._on_error = on_error
        self._tasks: set[asyncio.Task[None]] = set()
        self.loop = asyncio.new_event_loop()
        self.loop.set_exception_handler(self._note)
        run = self.loop.run_forever
        self._thread = threading.Thread(target=run, name="moteus-client", daemon=True)
        self._thread.start()

    def start_soon(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Begin work in the loop; returns at once."""
        self.loop.call_soon_threadsafe(self._create, work)

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do work in the loop and wait for its result."""
        future = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return future.result(seconds)
        except concurrent.futures.TimeoutError as error:
            future.cancel()
            raise HardwareError(
                f"The adapter did not answer within {seconds:g} s; unplug it and plug it in again."
            ) from error

    def close(self) -> None:
        """End the thread; one that is stuck in a system call is left behind."""
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(1.0)
        if not self._thread.is_alive():
            self.loop.close()

    def _create(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        task = self.loop.create_task(work())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _note(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        self._on_error(str(error or context.get("message", "unknown")))


class MoteusLink:
    """The way to two drives.

    Args:
        robot: Whose drives.
        open_transport: Opens the adapter.
        clock: None takes the computer's.
        client: Makes what does the client's work, given who is told of its errors.

    Attributes:
        trouble: What went wrong in the client last, for the record.

    Raises:
        HardwareError: The adapter cannot be opened.
    """

    def __init__(
        self,
        robot: Robot,
        open_transport: transport.Opener,
        clock: realtime.Clock | None = None,
        client: Callable[[Callable[[str], None]], Client] = ClientThread,
    ) -> None:
        self._clock = clock or realtime.RealClock()
        self.robot, self.transforms = robot, drive_link.joint_transforms(robot)
        self.trouble = ""
        self._limits = [joint.motor.torque_limit for joint in (robot.hip, robot.knee)]
        self._clocks = (replies.DriveClock(), replies.DriveClock())
        self._client = client(self._note)
        try:
            self.transport = self._client.call(self._open(open_transport), _OPENING_SECONDS)
        except HardwareError:
            self._client.close()
            raise
        self.controllers = [
            Controller(wire.id, query_resolution=_resolution(), transport=self.transport)
            for wire in self.transforms
        ]

    def exchange(self, outgoing: drive_link.DriveCommand, until: float) -> drive_link.Exchange:
        """Tell both drives what to do and ask for their state in the same frames."""
        question = replies.Question(self.transforms, self._clocks, self._clock.now())
        commands = self._commands(outgoing, query=True)
        for joint, command in enumerate(commands):
            command.reply_filter = functools.partial(self._judge, question, joint)
            command.parse = lambda frame: frame
        self._client.start_soon(lambda: self._ask(question, commands, until))
        question.done.wait(self._clock.patience(until))
        return question.result()

    def send(self, outgoing: drive_link.DriveCommand) -> None:
        """Tell both drives what to do; returns at once."""
        commands = self._commands(outgoing, query=False)
        until = self._clock.now() + _SEND_SECONDS
        self._client.start_soon(lambda: self._cycle(commands, until))

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do something slow in the client's thread; not while a leg is armed."""
        return self._client.call(work, seconds)

    def close(self) -> None:
        """Give the adapter back; another link may open it then."""
        try:
            self._client.call(self._close(), 2.0)
        except HardwareError as error:
            self._note(str(error))
        self._client.close()

    async def _ask(self, question: replies.Question, commands: list[Any], until: float) -> None:
        await self._cycle(commands, until)
        question.done.set()

    async def _cycle(self, commands: list[Any], until: float) -> None:
        """Send frames, and wait for replies as long as they are worth something."""
        patience = self._clock.patience(until)
        if patience <= 0:
            return
        try:
            async with asyncio.timeout(patience):
                await self.transport.cycle(commands)
        except TimeoutError:
            return
        except Exception as error:
            # The client and the serial port raise many types when the adapter is gone.
            self._note(str(error))

    def _commands(self, outgoing: drive_link.DriveCommand, *, query: bool) -> list[Any]:
        pairs = zip(self.controllers, self.transforms, outgoing.torque, self._limits, strict=True)
        match outgoing.action:
            case drive_link.Action.TORQUE:
                return [
                    controller.make_position(
                        **_NO_POSITION_CONTROL,
                        feedforward_torque=transform.motor_torque(torque),
                        maximum_torque=limit,
                        watchdog_timeout=self.robot.hardware.watchdog,
                        query=query,
                    )
                    for controller, transform, torque, limit in pairs
                ]
            case drive_link.Action.BRAKE:
                return [controller.make_brake(query=query) for controller in self.controllers]
            case drive_link.Action.STOP:
                return [controller.make_stop(query=query) for controller in self.controllers]

    def _judge(self, question: replies.Question, joint: int, frame: Any) -> bool:  # noqa: ANN401
        return question.take(joint, frame, self._clock.now())

    async def _open(self, open_transport: transport.Opener) -> Any:  # noqa: ANN401
        try:
            return open_transport()
        except HardwareError:
            raise
        except Exception as error:
            # Serial ports and python-can raise many types.
            raise HardwareError(f"Cannot open the adapter: {error}.") from error

    async def _close(self) -> None:
        self.transport.close()

    def _note(self, words: str) -> None:
        self.trouble = words


def _resolution() -> QueryResolution:
    resolution = QueryResolution()
    resolution.voltage = resolution.temperature = multiplex.INT16
    resolution._extra = {int(Register.MILLISECOND_COUNTER): multiplex.INT32}
    return resolution
