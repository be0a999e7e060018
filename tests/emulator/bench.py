"""An emulated robot on the bench: the client library's commands, time moved by hand."""

import math

import moteus
import numpy as np

from hopping_leg.deploy.frames import REPLY_WANTED, Frame, padded
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.io import replace_at
from hopping_leg.robot import JOINTS, load_robot
from hopping_leg.robot.model_mismatch import SensorMismatch

R = moteus.Register


def exact(robot):
    """Return a robot whose sensors have no noise to speak of."""
    sensor = SensorMismatch(position_noise=1e-15)
    for joint in JOINTS:
        robot = replace_at(robot, f"reality.{joint}.sensor", sensor)
    return robot


class Bench:
    """Two drives and their leg, asked in the unmodified client's words.

    ``strays`` are frames that nobody waited for.
    """

    def __init__(self, q=(0.6, -1.3), robot="legv2", **options):
        loaded = exact(load_robot(robot) if isinstance(robot, str) else robot)
        self.robot = EmulatedRobot(loaded, np.array(q), **options)
        self.drives = [moteus.Controller(id=n, transport=False) for n in (1, 2)]
        self.strays = []

    def wait(self, seconds):
        self.robot.advance(self.robot.time + seconds)

    def push(self, hip, knee=0.0, seconds=0.001, **more):
        """Command pure torques and wait."""
        self.torque(hip, knee, **more)
        self.wait(seconds)

    def cycle(self, *commands):
        """Send commands; return what the first reply says that each waits for and has arrived."""
        waiting, results = [], []
        for command in commands if self.robot.plugged else ():
            number = command.destination | command.source << 8
            asked = Frame(
                number | REPLY_WANTED * command.reply_required, padded(bytes(command.data))
            )
            self.robot.receive(asked)
            waiting += [(asked, command)] * command.reply_required
        for item in self.robot.reply_queue.take(self.robot.time):
            if item.frame is None or item.flip >= 0 or not self.robot.plugged:
                continue  # a CAN controller discards what was corrupted
            wants = [pair for pair in waiting if item.frame.answers(pair[0])]
            if wants:
                waiting.remove(wants[0])
                results.append(wants[0][1].parse(item.frame))
            else:
                self.strays.append(item.frame)
        return results

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
