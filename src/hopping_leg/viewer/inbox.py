"""What the page asks for, done between two pictures by the thread that simulates."""

import queue
from collections.abc import Callable, Coroutine
from typing import Any

import viser

from hopping_leg.errors import HoppingLegError

Wish = Callable[[], None]


def put_value(handle: Any, value: object) -> None:  # noqa: ANN401
    """Set an input of the page; viser's types take its values for read-only."""
    handle.value = value


class Inbox:
    """Wishes in the order in which they came; callbacks of the page only put them in."""

    def __init__(self) -> None:
        self._wishes: queue.SimpleQueue[Wish] = queue.SimpleQueue()

    def put(self, wish: Wish) -> None:
        """Ask for something; any thread may."""
        self._wishes.put(wish)

    def work(self) -> list[str]:
        """Do all that was asked for; return the sentences of what could not be done."""
        complaints: list[str] = []
        while True:
            try:
                wish = self._wishes.get_nowait()
            except queue.Empty:
                return complaints
            try:
                wish()
            except HoppingLegError as error:
                complaints.append(str(error))

    def from_page(self, wish: Wish) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return a callback for an input or button; what the server itself sets is no wish."""

        async def callback(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                self.put(wish)

        return callback

    def from_keys(self, wish: Wish) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return a callback for a key."""

        async def callback(_: object) -> None:
            self.put(wish)

        return callback
