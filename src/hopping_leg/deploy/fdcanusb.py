"""The client library's fdcanusb without what would silence or hang it.

Of ``moteus`` 1.1: a line that is no answer, or a broken one, ends its reader task without a word;
an adapter that is gone wakes the event loop forever; and a closed port stays registered with the
loop, so that the next one with its number never reads.
"""

import asyncio
from typing import Any

from moteus import FdcanusbDevice


class TolerantFdcanusb(FdcanusbDevice):  # type: ignore[misc]
    """An fdcanusb that skips what it cannot read.

    Must be made inside of a running event loop.

    Args:
        path: Of the serial port.
    """

    def __init__(self, path: str) -> None:
        self.garbage = 0
        """Lines that were skipped."""
        super().__init__(path)
        self._loop = asyncio.get_running_loop()
        self._descriptor: int | None = self._serial.fd
        self._loop.add_reader(self._serial.fd, self._read)

    @property
    def gone(self) -> bool:
        """Whether the adapter was pulled out, or the port closed."""
        return self._descriptor is None

    def _read(self) -> None:
        try:
            self._serial._handle_read()
        except OSError:
            self._abandon()

    async def _process_one_line(self) -> Any:  # noqa: ANN401
        try:
            return await super()._process_one_line()
        except (ValueError, IndexError):
            self.garbage += 1
            return False

    async def _handle_other_response(self, line: bytes) -> None:
        self.garbage += 1

    def _abandon(self) -> None:
        if self._descriptor is not None:
            self._loop.remove_reader(self._descriptor)
            self._descriptor = None

    def close(self) -> None:
        """Give the port back; another may be opened after it."""
        self._abandon()
        super().close()
