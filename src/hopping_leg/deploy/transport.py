"""The adapters, for one host at a time: an fdcanusb, or a bus of python-can.

None of them ever waits beyond the time that it is given, whatever the adapter does. The client
library's own wait for a lost reply without bound, lose the healthy drive's reply when they are
cancelled, and are silenced by a line of noise.
"""

import time
from collections.abc import Sequence
from pathlib import Path

import can

from hopping_leg import locks
from hopping_leg.deploy.fdcanusb import Fdcanusb, LineTransport, opened
from hopping_leg.deploy.frames import Frame, padded
from hopping_leg.errors import HardwareError, UsageError

_FORMS = (
    "the path of an fdcanusb (e.g. /dev/serial/by-id/...), or interface:channel of python-can"
    " (e.g. socketcan:can0)"
)


def open_transport(name: str) -> "Transport":
    """Open what a name means, or raise UsageError; HardwareError where it cannot be opened."""
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
        self._bus.shutdown()
        self._lock.release()


Transport = LineTransport | PythonCan
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
