"""An emulated robot on the bench: the client library's commands, time moved by hand."""

import asyncio
import dataclasses
import math

import moteus
import numpy as np
from moteus.transport_device import Frame as ClientFrame
from moteus.transport_device import TransportDevice

from hopping_leg.deploy.frames import Frame, padded
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.robot import load_robot
from hopping_leg.robot.model_mismatch import SensorMismatch

R = moteus.Register


class MemoryTransport(TransportDevice):
    """A device whose transactions take no time; replies that are late or lost stay away."""

    def __init__(self, robot):
        super().__init__()
        self.robot = robot

    def empty_bus_tx_safe(self):
        """Return True: anything may be sent."""
        return True

    async def send_frame(self, frame):
        """Send a frame; replies go to the receive queue."""
        self._send(frame)
        for reply in self._replies():
            await self._handle_received_frame(reply)

    async def transaction(self, requests, **_):
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

    def _send(self, frame):
        if self.robot.plugged:
            self.robot.receive(Frame(frame.arbitration_id, padded(bytes(frame.data))))

    def _replies(self):
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
            if item.frame is not None and item.flip < 0 and self.robot.plugged
        ]


def exact(robot):
    """Return a robot whose sensors have no noise to speak of."""
    sensor = SensorMismatch(position_noise=1e-15)
    drives = {
        name: dataclasses.replace(getattr(robot.reality, name), sensor=sensor)
        for name in ("hip", "knee")
    }
    return dataclasses.replace(robot, reality=dataclasses.replace(robot.reality, **drives))


class Bench:
    """Two drives and their leg, asked through the unmodified client."""

    def __init__(self, q=(0.6, -1.3), robot="legv2", **options):
        loaded = exact(load_robot(robot) if isinstance(robot, str) else robot)
        self.robot = EmulatedRobot(loaded, np.array(q), **options)
        self.transport = moteus.Transport([MemoryTransport(self.robot)])
        self.drives = [moteus.Controller(id=n, transport=self.transport) for n in (1, 2)]

    def wait(self, seconds):
        self.robot.advance(self.robot.time + seconds)

    def push(self, hip, knee=0.0, seconds=0.001, **more):
        """Command pure torques and wait."""
        self.torque(hip, knee, **more)
        self.wait(seconds)

    def cycle(self, *commands):
        return asyncio.run(self.transport.cycle(list(commands)))

    run = staticmethod(asyncio.run)

    def torque(self, *torques, watchdog=1.0, maximum=20.0, **more):
        """Command pure torques; return the replies."""
        frame = {"position": math.nan, "velocity": 0.0, "kp_scale": 0.0, "kd_scale": 0.0}
        frame |= {"ilimit_scale": 0.0, "maximum_torque": maximum, "watchdog_timeout": watchdog}
        frame |= {"query": True, **more}
        pairs = zip(self.drives, torques, strict=True)
        return self.cycle(*(d.make_position(feedforward_torque=t, **frame) for d, t in pairs))

    def power(self, **more):
        """Bring both drives into torque mode at zero torque."""
        self.push(0.0, seconds=0.02, **more)
        assert self.modes() == [10, 10]

    def read(self, *registers, drive=0, resolution=moteus.F32):
        query = self.drives[drive].make_custom_query(dict.fromkeys(registers, resolution))
        (result,) = self.cycle(query)
        values = [result.values.get(int(register)) for register in registers]
        return values[0] if len(values) == 1 else values

    def modes(self):
        return [self.read(R.MODE, drive=n) for n in (0, 1)]

    def faults(self):
        return [self.read(R.FAULT, drive=n) for n in (0, 1)]
