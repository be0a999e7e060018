"""The emulated drives on a bus of python-can, which stands for socketcan and its like.

``udp_multicast`` needs neither root nor a kernel that knows CAN; ``socketcan`` on a ``vcan`` works
as well where there is one.
"""

import can

from hopping_leg.emulator.frames import Frame
from hopping_leg.emulator.reply_queue import QueuedReply
from hopping_leg.errors import UsageError

UDP_MULTICAST = "udp_multicast"
"""The interface that needs no driver."""

DEFAULT_CHANNELS = {UDP_MULTICAST: "239.74.163.2", "socketcan": "vcan0"}
"""Interfaces of python-can that the emulator serves, with the channel that it takes by default."""


class CanPort:
    """One node on a CAN-FD bus that speaks for both drives.

    Args:
        interface: One of ``DEFAULT_CHANNELS``.
        channel: Of the interface; none takes the default.

    Raises:
        UsageError: The bus cannot be opened.
    """

    def __init__(self, interface: str = UDP_MULTICAST, channel: str | None = None) -> None:
        self.interface = interface
        self.channel = channel or DEFAULT_CHANNELS[interface]
        self._bus: can.BusABC | None = None
        self.plug_in()

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel}"

    @property
    def plugged(self) -> bool:
        """Whether the drives are on the bus."""
        return self._bus is not None

    def plug_in(self) -> None:
        """Join the bus.

        Raises:
            UsageError: The bus cannot be opened.
        """
        try:
            self._bus = can.Bus(interface=self.interface, channel=self.channel, fd=True)
        except (can.CanError, OSError, ImportError) as error:
            raise UsageError(
                f"Cannot open {self.interface} '{self.channel}': {error}; udp_multicast needs a"
                " network interface that knows multicast and the package msgpack."
            ) from error

    def unplug(self) -> None:
        """Leave the bus: the host's frames are heard by nobody."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    close = unplug

    def fileno(self) -> int:
        """Return the descriptor to wait for; -1 while unplugged."""
        return -1 if self._bus is None else int(self._bus.fileno())

    def receive(self) -> list[Frame]:
        """Return frames that were sent on the bus."""
        frames: list[Frame] = []
        while self._bus is not None:
            try:
                message = self._bus.recv(timeout=0)
            except can.CanError:
                continue  # noise that is no frame
            if message is None:
                break
            frames.append(Frame(message.arbitration_id, bytes(message.data)))
        return frames

    def send(self, item: QueuedReply) -> None:
        """Send a frame; noise and corrupted frames are discarded by CAN controllers."""
        if self._bus is None or item.frame is None or item.flip >= 0:
            return
        self._bus.send(
            can.Message(
                arbitration_id=item.frame.arbitration_id,
                is_extended_id=item.frame.extended,
                data=item.frame.data,
                is_fd=True,
                bitrate_switch=True,
            )
        )
