"""An emulated robot as a device of the client library, in one process and with no clock of its own.

The unmodified ``moteus.Transport`` takes it like any adapter. Time passes only when the caller lets
the robot advance, so tests are as fast as the processor and always the same.
"""

from typing import Any

from moteus.transport_device import Frame as ClientFrame
from moteus.transport_device import TransportDevice

from hopping_leg.emulator.frames import Frame, padded
from hopping_leg.emulator.robot import EmulatedRobot


class MemoryTransport(TransportDevice):  # type: ignore[misc]
    """A device whose transactions take no time; replies that are late or lost stay away.

    Args:
        robot: Behind it.
    """

    def __init__(self, robot: EmulatedRobot) -> None:
        super().__init__()
        self.robot = robot

    def empty_bus_tx_safe(self) -> bool:
        """Return True: anything may be sent."""
        return True

    async def send_frame(self, frame: ClientFrame) -> None:
        """Send a frame; replies go to the receive queue."""
        self._send(frame)
        for reply in self._replies():
            await self._handle_received_frame(reply)

    async def transaction(self, requests: list[Any], **_: object) -> None:
        """Send requests; each gets the first reply that it waits for and that has arrived."""
        for request in requests:
            self._send(request.frame)
        for reply in self._replies():
            for request in requests:
                wants = request.frame_filter is not None and request.frame_filter(reply)
                if wants and not request.responses:
                    request.responses.append(reply)
                    break
            else:
                await self._handle_received_frame(reply)

    def _send(self, frame: ClientFrame) -> None:
        if self.robot.fault_injector.plugged:
            self.robot.receive(Frame(frame.arbitration_id, padded(bytes(frame.data))))

    def _replies(self) -> list[ClientFrame]:
        """Return what arrives now; a CAN controller discards what was corrupted."""
        items = self.robot.reply_queue.take(self.robot.time)
        return [
            ClientFrame(
                arbitration_id=item.frame.arbitration_id,
                data=item.frame.data,
                dlc=len(item.frame.data),
                is_extended_id=item.frame.extended,
                is_fd=True,
                bitrate_switch=True,
                channel=self,
            )
            for item in items
            if item.frame is not None and item.flip < 0 and self.robot.fault_injector.plugged
        ]
