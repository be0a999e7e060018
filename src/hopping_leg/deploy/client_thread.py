"""The asyncio client in a thread of its own, so that nothing it does can hang the control loop."""

import asyncio
import concurrent.futures
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Protocol, TypeVar

from hopping_leg.errors import HardwareError

Result = TypeVar("Result")


class Client(Protocol):
    """Where the asyncio client's work is done."""

    def start_soon(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Begin work; never waits for the motors."""
        ...

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do work and wait for its result.

        Raises:
            HardwareError: It took too long.
        """
        ...

    def close(self) -> None:
        """End it."""
        ...


class ClientThread:
    """Runs an event loop; work is handed over and never waited for without a deadline.

    Args:
        on_error: Told what went wrong inside of the loop, in a few words.
    """

    def __init__(self, on_error: Callable[[str], None]) -> None:
        self._on_error = on_error
        self._tasks: set[asyncio.Task[None]] = set()
        self.loop = asyncio.new_event_loop()
        self.loop.set_exception_handler(self._note)
        self._thread = threading.Thread(target=self._run, name="moteus-client", daemon=True)
        self._thread.start()

    def start_soon(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Begin work in the loop; returns at once."""
        self.loop.call_soon_threadsafe(self._create, work)

    def call(self, work: Coroutine[Any, Any, Result], seconds: float) -> Result:
        """Do work in the loop and wait for its result.

        Raises:
            HardwareError: It took too long.
        """
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

    def _run(self) -> None:
        asyncio.set_event_loop(self.loop)
        self.loop.run_forever()

    def _create(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        task = self.loop.create_task(work())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _note(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        self._on_error(str(error or context.get("message", "unknown")))
