import asyncio
import os

import can
import moteus
import pytest
from moteus.pythoncan_device import PythonCanDevice

from hopping_leg.emulator.process import EmulatorProcess
from hopping_leg.emulator.server import EmulatorConfig
from hopping_leg.errors import UsageError

CHANNEL = f"239.74.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
"""A multicast group of this process, so that tests side by side do not hear each other."""


def test_the_client_drives_the_leg_over_udp():
    async def talk():
        device = PythonCanDevice(interface="udp_multicast", channel=CHANNEL, fd=True)
        transport = moteus.Transport([device])
        drives = [moteus.Controller(id=n, transport=transport) for n in (1, 2)]
        try:
            command = {"position": float("nan"), "kp_scale": 0.0, "kd_scale": 0.0, "query": True}
            command |= {"watchdog_timeout": 2.0, "feedforward_torque": 0.05}
            for _ in range(20):
                await asyncio.wait_for(transport.cycle([d.make_stop() for d in drives]), 5)
                replies = transport.cycle([d.make_position(**command) for d in drives])
                results = await asyncio.wait_for(replies, 5)
            return [result.id for result in results]
        finally:
            transport.close()

    with EmulatorProcess(EmulatorConfig(interface="udp_multicast", channel=CHANNEL)) as emulator:
        assert asyncio.run(talk()) == [1, 2]
        with can.Bus(interface="udp_multicast", channel=CHANNEL, fd=True) as bus:
            bus.send(can.Message(arbitration_id=0x8003, data=b"noise", is_fd=True))
        assert emulator.state().time > 0


def test_interfaces_that_cannot_be_opened_are_named():
    with pytest.raises(UsageError, match="There is no interface 'usb'"):
        EmulatorConfig(interface="usb").open()
    with pytest.raises(UsageError, match="Cannot open socketcan 'nowhere0'"):
        EmulatorConfig(interface="socketcan", channel="nowhere0").open()
    with pytest.raises(UsageError, match="a CAN bus has a channel"):
        EmulatorConfig(interface="udp_multicast", link="/tmp/leg").open()
