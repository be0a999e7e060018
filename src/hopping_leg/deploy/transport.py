"""The adapters, for one host at a time: an fdcanusb, a bus of python-can, or a pi3hat.

None of them ever waits beyond the time that it is given, whatever the adapter does. The client
library's own wait for a lost reply without bound, lose the healthy drive's reply when they are
cancelled, and are silenced by a line of noise.
"""

import argparse
import asyncio
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import can
import moteus
from moteus.command import Command
from moteus.transport_factory import get_transport_factories

from hopping_leg import locks
from hopping_leg.deploy.fdcanusb import Fdcanusb, opened
from hopping_leg.deploy.frames import Frame, padded
from hopping_leg.errors import HardwareError, UsageError

_FORMS = (
    "the path of an fdcanusb (e.g. /dev/serial/by-id/...), interface:channel of python-can"
    " (e.g. socketcan:can0), or pi3hat"
)


class Transport(Protocol):
    """Carries frames; what it cannot carry is lost, and ``trouble`` says why.

    Attributes:
        trouble: What went wrong last, for the record.
    """

    trouble: str

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames now or never."""

    def receive(self, until: float) -> list[Frame] | None:
        """Return the frames of what arrives next; None if nothing does until a time, s."""

    def close(self) -> None:
        """Give the adapter back; another may be opened after it."""


def open_transport(name: str) -> Transport:
    """Open what a name means.

    Raises:
        UsageError: It names no transport.
        HardwareError: It is in use, or cannot be opened.
    """
    if name == "pi3hat":
        return Pi3hat(_open_pi3hat)
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
    """A CAN-FD bus of python-can.

    Raises:
        HardwareError: It is in use or cannot be opened.
    """

    def __init__(self, interface: str, channel: str) -> None:
        self.trouble = ""
        name = f"{interface}:{channel}"
        self._lock = locks.named_lock(f"host-{name}", name, HardwareError)
        self._bus = opened(self._lock, lambda: open_bus(interface, channel))

    def send(self, frames: Sequence[Frame]) -> None:
        """Send what the bus takes at once."""
        try:
            for frame in frames:
                self._bus.send(message_of(frame), timeout=0.0)
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
        self._lock.close()


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


def message_of(frame: Frame) -> can.Message:
    """Return a frame as python-can knows it."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.extended,
        data=padded(frame.data),
        is_fd=True,
        bitrate_switch=True,
    )


_LONGEST_REPLY = 64  # bytes
_SEND_SECONDS = 0.004  # A command that could not leave within this time is outdated
_LEAST_SECONDS = 0.001  # In which what is asked leaves, also in a tick that began late


class Pi3hat:
    """The client library's own transport: its event loop runs only while something is asked of it.

    Args:
        make: Makes the library's devices.

    Raises:
        HardwareError: The hat is in use or cannot be opened.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self.trouble = ""
        self._lock = locks.named_lock("host-pi3hat", "pi3hat", HardwareError)
        self._transport = opened(self._lock, lambda: moteus.Transport(make()))
        self._loop, self._asked = asyncio.new_event_loop(), list[Frame]()

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames; those that want a reply leave when it is received, as the hat needs it."""
        self._asked = [frame for frame in frames if frame.wants_reply]
        rest = [_command(frame, []) for frame in frames if not frame.wants_reply]
        if rest:
            self._run(self._transport.cycle(rest), _SEND_SECONDS)

    def receive(self, until: float) -> list[Frame] | None:
        """Return what arrives next."""
        heard: list[Any] = []
        asked, self._asked = [_command(frame, heard) for frame in self._asked], []
        work = self._transport.cycle(asked) if asked else self._transport.read()
        got = self._run(work, max(until - time.monotonic(), _LEAST_SECONDS))
        if not asked and got is not None:
            heard.append(got)
        return [Frame(f.arbitration_id, bytes(f.data)) for f in heard] or None

    def close(self) -> None:
        """Close the hat."""
        self._transport.close()
        self._loop.close()
        self._lock.close()

    def _run(self, work: Any, seconds: float) -> Any:  # noqa: ANN401
        """Return the result of work, None if it took too long or failed."""
        try:
            return self._loop.run_until_complete(asyncio.wait_for(work, seconds))
        except TimeoutError:
            return None
        except Exception as error:  # the library raises many types
            self.trouble = str(error)
            return None


def _command(frame: Frame, heard: list[Any]) -> Command:
    """Return a frame as the library knows it; what answers it is appended to ``heard``."""
    command = Command()
    command.destination, command.source = frame.destination, frame.source
    command.data, command.reply_required = frame.data, frame.wants_reply
    command.expected_reply_size = _LONGEST_REPLY * frame.wants_reply

    def hear(reply: Any) -> bool:  # noqa: ANN401
        heard.append(reply)
        return True

    command.reply_filter = hear
    return command


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
