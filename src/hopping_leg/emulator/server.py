"""The emulated robot in real time behind a port: how it starts, and the thread that serves it.

One thread does all: it waits for the host, the next step or the next reply, lets the robot catch up
with the clock, and answers.
"""

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.leg import TIMESTEP
from hopping_leg.emulator.ports import LinePort, PtyPort
from hopping_leg.emulator.reply_queue import QueuedReply
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot import DEFAULT_ROBOT, Robot, kinematics, load_robot

_STANDING = 0.69  # Length of a leg that stands over the straight leg's, foot below the hip

POSES = ("stand", "zero")
"""Named poses; ``zero`` is the leg straight down, where the joints' angles are zero."""


@dataclass(frozen=True)
class EmulatorConfig:
    """What is emulated and how it begins."""

    robot: str = DEFAULT_ROBOT
    """A shipped robot or a .toml file; its [reality] holds."""
    pose: str = "stand"
    """One of POSES or joint angles as 'HIP,KNEE' in rad."""
    configured: bool = True
    """Drives configured as the robot's file asks; else as delivered, but for their ids."""
    homed: bool = True
    """Drives homed, as somebody did by hand; else known only within a turn of their rotors."""
    held: bool = True
    """Somebody holds the leg until both drives are powered."""
    seed: int = 0
    """Seed of sensor noise and jitter."""
    faults: tuple[Fault, ...] = ()
    """What goes wrong, and when."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""

    def build(self) -> EmulatedRobot:
        """Return the emulated robot; RobotError refuses the robot, UsageError the pose."""
        robot = load_robot(self.robot)
        robot.require_leg()
        return EmulatedRobot(
            robot, posture(robot, self.pose), configured=self.configured, homed=self.homed,
            held=self.held, seed=self.seed, faults=self.faults,
        )  # fmt: skip


def posture(robot: Robot, pose: str) -> Array:
    """Return the joint angles of a named or given pose, rad, (2,); UsageError for any other."""
    if pose == "zero":
        return np.zeros(2)
    if pose == "stand":
        length = _STANDING * (robot.thigh.length + robot.shank.length)
        return kinematics.joint_angles(robot, np.array([length, 0.0]))
    try:
        hip, knee = (float(part) for part in pose.split(","))
    except ValueError as error:
        valid = unknown_name("pose", pose, POSES)
        raise UsageError(f"{valid} Or give joint angles, rad, e.g. 0.6,-1.3.") from error
    return np.array([hip, knee])


_FURTHEST = 0.02
"""Most that is caught up with at once after the process was held off, s; the rest is lost."""


class Server:
    """Runs an emulated robot behind a port."""

    def __init__(self, robot: EmulatedRobot, port: LinePort) -> None:
        self.robot, self.port = robot, port
        self.on_turn: Callable[[], None] = lambda: None
        """Called after every step, e.g. to show the state."""
        self.lost = 0.0  # Time that was not simulated as the process did not get the processor, s
        self._offset = time.monotonic() - robot.time

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop`` says so."""
        while not stop():
            self.turn()

    def turn(self) -> None:
        """Wait for the host or the clock, then do what is due."""
        waiting = [self.port] if self.port.plugged else []
        due = min(self.robot.time + TIMESTEP, self.robot.reply_queue.next_due())
        patience = max(due + self._offset - time.monotonic(), 0.0)
        ready, _, _ = select.select(waiting, [], [], patience)
        self._catch_up()
        serve(self.robot, self.port, ready=bool(ready))
        self.on_turn()

    def _catch_up(self) -> None:
        now = time.monotonic() - self._offset
        behind = now - self.robot.time
        if (lost := behind - _FURTHEST) > 0:
            self._offset += lost
            self.lost += lost
            for drive in self.robot.drives:  # whose clocks go on
                drive.uptime += lost
            now -= lost
        self.robot.advance(now)


def serve(robot: EmulatedRobot, port: LinePort, *, ready: bool) -> None:
    """Hand over what is due, also from the host if it is ``ready``; pull or push the plug."""
    sensor = robot.robot.hardware.height
    if "/" in sensor.source:
        port.sensor = port.sensor or PtyPort(Path(sensor.source))
        port.sensor.send(QueuedReply(noise=b"%.6f" % sensor.reading(robot.leg.height)))
    if ready and port.plugged:
        for frame in port.receive():
            robot.receive(frame)
            _deliver(robot, port)  # the host reads it while the next one is answered
    _deliver(robot, port)
    if robot.plugged and not port.plugged:
        port.plug_in()
    elif port.plugged and not robot.plugged:
        port.unplug()


def _deliver(robot: EmulatedRobot, port: LinePort) -> None:
    for item in robot.reply_queue.take(robot.time):
        if port.plugged:
            port.send(item)
