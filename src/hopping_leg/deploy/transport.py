"""Which adapter, for one host at a time: path of an fdcanusb, python-can interface, or pi3hat."""

import argparse
import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
from moteus import FdcanusbDevice, PythonCanDevice, Transport
from moteus.transport_factory import get_transport_factories

from hopping_leg import locks
from hopping_leg.errors import HardwareError, UsageError

Opener = Callable[[], Any]
"""Makes a ``moteus.Transport``; must be called inside of a running event loop."""

_FORMS = (
    "the path of an fdcanusb (e.g. /dev/serial/by-id/...), interface:channel of python-can"
    " (e.g. socketcan:can0), or pi3hat"
)


class TolerantFdcanusb(FdcanusbDevice):  # type: ignore[misc]
    """The client library's fdcanusb without what would silence or hang it.

    In ``moteus`` 1.1 a line that is no answer, or a broken one, ends its reader task without a
    word; an adapter that is gone wakes the event loop forever; and a closed port stays registered
    with the loop, so that the next one with its number never reads.

    Must be made inside of a running event loop; raises HardwareError where the port is in use.
    """

    def __init__(self, path: str) -> None:
        self._lock = locks.Lock(Path(path), path, HardwareError)
        try:
            super().__init__(path)
        except BaseException:
            self._lock.close()
            raise
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
            return False

    async def _handle_other_response(self, line: bytes) -> None:
        """Skip the line."""

    def _abandon(self) -> None:
        if self._descriptor is not None:
            self._loop.remove_reader(self._descriptor)
            self._descriptor = None

    def close(self) -> None:
        """Give the port back; another may be opened after it."""
        self._abandon()
        super().close()
        self._lock.close()


def opener(name: str) -> Opener:
    """Return what opens a transport.

    Raises:
        UsageError: It names no transport.
    """
    if name == "pi3hat":
        return lambda: _alone("pi3hat", _open_pi3hat)
    if "/" in name:
        if not Path(name).exists():
            raise UsageError(f"There is no serial port {name}; give {_FORMS}.")
        return lambda: Transport([TolerantFdcanusb(name)])
    interface, colon, channel = name.partition(":")
    if not (interface and colon and channel):
        raise UsageError(f"There is no transport '{name}'; give {_FORMS}.")
    if interface not in can.VALID_INTERFACES:
        valid = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"python-can has no interface '{interface}'; it has: {valid}.")
    return lambda: _alone(
        name, lambda: [PythonCanDevice(interface=interface, channel=channel, fd=True)]
    )


def _alone(name: str, make: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Return a transport of devices that no other host of this computer uses until it is closed."""
    lock = locks.named_lock(f"host-{name}", name, HardwareError)
    try:
        transport = Transport(make())
    except BaseException:
        lock.close()
        raise
    close = transport.close

    def give_back() -> None:
        close()
        lock.close()

    transport.close = give_back
    return transport


def _open_pi3hat() -> Any:  # noqa: ANN401
    for factory in get_transport_factories():
        if factory.name == "pi3hat":
            parser = argparse.ArgumentParser()
            factory.add_args(parser)
            return factory(parser.parse_args([]))
    raise HardwareError(
        "The pi3hat needs moteus-pi3hat, which exists for the Raspberry Pi alone:"
        " pip install 'hopping-leg[pi3hat]'."
    )
