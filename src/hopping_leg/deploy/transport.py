"""The adapters, for one host at a time: an fdcanusb, a bus of python-can, or a pi3hat.

None of them waits beyond the time that it is given, whatever the adapter does; a pi3hat ends its
cycle, which takes about 1 ms. The client library's own wait for a lost reply without bound,
lose the healthy drive's reply when they are cancelled, and are silenced by a line of noise.
"""

import asyncio
import threading
import time
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import can
import moteus

from hopping_leg import locks
from hopping_leg.deploy.fdcanusb import Fdcanusb, LineTransport, opened
from hopping_leg.deploy.frames import Frame, padded
from hopping_leg.errors import HardwareError, UsageError

_FORMS = (
    "the path of an fdcanusb (e.g. /dev/serial/by-id/...), interface:channel of python-can"
    " (e.g. socketcan:can0), or pi3hat"
)


def open_transport(name: str) -> "Transport":
    """Open what a name means, or raise UsageError; HardwareError where it cannot be opened."""
    if name == "pi3hat":
        from moteus_pi3hat import Pi3HatFactory

        return Pi3Hat(partial(Pi3HatFactory(), None))
    if "/" in name:
        if not Path(name).exists():
            raise UsageError(f"There is no serial port {name}; give {_FORMS}.")
        return Fdcanusb(name)
    interface, colon, channel = name.partition(":")
    if not (interface and colon and channel):
        raise UsageError(f"There is no transport '{name}'; give {_FORMS}.")
    if interface not in can.VALID_INTERFACES:
        valid = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"python-can has no interface '{interface}'; it has: {valid}.")
    return PythonCan(interface, channel)


class PythonCan:
    """A CAN-FD bus of python-can; HardwareError says that it is in use or cannot be opened."""

    def __init__(self, interface: str, channel: str) -> None:
        self.trouble = ""
        name = f"{interface}:{channel}"
        self._lock = locks.named_lock(f"host-{name}", name, HardwareError)
        self._bus = opened(self._lock.release, lambda: open_bus(interface, channel))

    def send(self, frames: Sequence[Frame]) -> None:
        """Send what the bus takes at once."""
        try:
            for frame in frames:
                message = can.Message(
                    arbitration_id=frame.arbitration_id,
                    is_extended_id=frame.extended,
                    data=padded(frame.data),
                    is_fd=True,
                    bitrate_switch=True,
                )
                self._bus.send(message, timeout=0.0)
        except (can.CanError, OSError) as error:
            self.trouble = str(error)

    def receive(self, until: float) -> list[Frame] | None:
        """Return the next frame; messages that are none are skipped."""
        try:
            message = self._bus.recv(max(until - time.monotonic(), 0.0))
        except (can.CanError, OSError) as error:
            self.trouble = str(error)
            return []
        if message is None:
            return None
        if message.is_error_frame:
            return []
        return [Frame(message.arbitration_id, bytes(message.data))]

    def close(self) -> None:
        """Leave the bus."""
        try:
            self._bus.shutdown()
        finally:
            self._lock.release()


_MOST_SECONDS = 0.05  # That a wait for replies keeps another thread from sending
_TURN_SECONDS = 0.2  # In which another thread's turn is over, unless the hat hangs
_REST_SECONDS = 0.01  # In which the library's thread leaves Python; closed before, it deadlocks


class Pi3Hat:
    """A pi3hat's buses; a drive is told on all of them until an answer tells where it is.

    ``make`` returns the client library's devices, one a bus, whose event loop runs only while
    something is asked of them. The library would wait for each reply, and lose what it has heard
    when that takes too long; so it is told of none, and asked what arrives. HardwareError says
    that the hat is in use or cannot be opened.
    """

    def __init__(self, make: Callable[[], list[Any]]) -> None:
        self.trouble = ""
        self._lock = locks.named_lock("host-pi3hat", "pi3hat", HardwareError)
        buses = opened(self._lock.release, make)
        self._hat, self._safe = buses[0].parent(), [b for b in buses if b.empty_bus_tx_safe()]
        self._found = dict[int, list[Any]]()
        self._runner, self._turn = asyncio.Runner(), threading.Lock()

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames, in a cycle of the hat, which takes about 1 ms."""
        requests = [
            moteus.TransportDevice.Request(moteus.Frame(f.arbitration_id, padded(f.data)), bus)
            for f in frames
            for bus in self._found.get(f.destination, self._safe)
        ]
        self._run(self._hat.transaction(requests))

    def receive(self, until: float) -> list[Frame] | None:
        """Return the next frame; HardwareError says that two drives have one id."""
        seconds = min(until - time.monotonic(), _MOST_SECONDS)
        heard = self._run(asyncio.wait_for(self._hat.receive_frame(), seconds))
        if heard is None:
            return [] if time.monotonic() < until else None
        frame = Frame(heard.arbitration_id, bytes(heard.data))
        if (known := self._found.setdefault(frame.source, [heard.channel])) != [heard.channel]:
            raise HardwareError(
                f"At {known[0]} and {heard.channel} are drives of id {frame.source}; give each"
                " drive its own."
            )
        return [frame]

    def close(self) -> None:
        """Close the hat; the lock is given back also where the library fails or hangs."""
        try:
            if self._turn.acquire(timeout=_TURN_SECONDS):  # for good
                self._runner.close()
                time.sleep(_REST_SECONDS)
                self._hat.close()
        finally:
            self._lock.release()

    def _run(self, work: Coroutine[Any, Any, Any]) -> Any:  # noqa: ANN401
        """Return the result of work, None if it took too long or failed."""
        if not self._turn.acquire(timeout=_TURN_SECONDS):  # a hanging loop's, which is braked
            work.close()
            self.trouble = "The pi3hat hangs, or is closed."
            return None
        try:
            return self._runner.run(work)
        except TimeoutError:
            return None
        except Exception as error:  # the library raises many types
            self.trouble = str(error)
            return None
        finally:
            self._turn.release()


Transport = LineTransport | PythonCan | Pi3Hat
"""Carries frames; what it cannot carry is lost, and ``trouble`` says why."""


def open_bus(interface: str, channel: str) -> can.BusABC:
    """Open a CAN-FD bus; python-can raises many types where it cannot."""
    if interface != "pcan":
        return can.Bus(interface=interface, channel=channel, fd=True)
    timing = can.BitTimingFd.from_sample_point(  # moteus' rates, with the adapter's 80 MHz
        f_clock=80_000_000,
        nom_bitrate=1_000_000,
        nom_sample_point=66.0,
        data_bitrate=5_000_000,
        data_sample_point=66.0,
    )
    return can.Bus(interface=interface, channel=channel, timing=timing)
