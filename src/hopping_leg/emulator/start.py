"""How an emulation begins: which robot, in which pose, with which drives."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.pty_port import PtyPort
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.emulator.server import Port
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.robot import kinematics, load_robot
from hopping_leg.robot.parameters import Robot

_LENGTHS = {"stand": 0.69, "crouch": 0.5, "stretch": 0.93}
"""Named poses: leg length over the straight leg's, foot below the hip."""

POSES = (*_LENGTHS, "zero")
"""Named poses; ``zero`` is the leg straight down, where the joints' angles are zero."""

PTY = "pty"
"""A serial terminal, as an fdcanusb's."""


@dataclass(frozen=True)
class Start:
    """What is emulated and how it begins."""

    robot: str = "legv2"
    """A shipped robot or a .toml file; its [reality] holds."""
    pose: str = "stand"
    """One of POSES or joint angles as 'HIP,KNEE' in rad."""
    configured: bool = True
    """Drives configured as the robot's file asks; else as the firmware is delivered."""
    homed: bool = True
    """Drives homed, as somebody did by hand; else known only within a turn of their rotors."""
    held: bool = True
    """Somebody holds the leg until both drives are powered."""
    seed: int = 0
    """Of sensor noise and jitter."""
    faults: tuple[Fault, ...] = ()
    """What goes wrong, and when."""
    interface: str = PTY
    """How the host reaches it: ``pty`` or a bus of python-can, see ``can_bus``."""
    channel: str | None = None
    """Of a bus; none takes the interface's default."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""

    def build(self) -> EmulatedRobot:
        """Return the emulated robot.

        Raises:
            RobotError: The robot is unknown, wrong or cannot stand.
            UsageError: The pose is unknown.
        """
        robot = load_robot(self.robot)
        robot.require_leg()
        return EmulatedRobot(
            robot,
            posture(robot, self.pose),
            configured=self.configured,
            homed=self.homed,
            held=self.held,
            seed=self.seed,
            faults=self.faults,
        )

    def open(self) -> Port:
        """Return the adapter.

        Raises:
            UsageError: The interface has no such option or cannot be opened.
        """
        if self.interface == PTY:
            if self.channel is not None:
                raise UsageError("A channel is for CAN buses; a pty has a link.")
            return PtyPort(self.link)
        if self.link is not None:
            raise UsageError("A link is for the interface pty; a CAN bus has a channel.")
        from hopping_leg.emulator.can_bus import DEFAULT_CHANNELS, CanPort

        if self.interface not in DEFAULT_CHANNELS:
            raise UsageError(unknown_name("interface", self.interface, (PTY, *DEFAULT_CHANNELS)))
        return CanPort(self.interface, self.channel)


def posture(robot: Robot, pose: str) -> Array:
    """Return the joint angles of a named or given pose, rad, (2,).

    Raises:
        UsageError: There is no such pose.
    """
    if pose == "zero":
        return np.zeros(2)
    if pose in _LENGTHS:
        length = _LENGTHS[pose] * (robot.thigh.length + robot.shank.length)
        return kinematics.joint_angles(robot, np.array([length, 0.0]))
    try:
        hip, knee = (float(part) for part in pose.split(","))
    except ValueError as error:
        valid = unknown_name("pose", pose, POSES)
        raise UsageError(f"{valid} Or give joint angles, rad, e.g. 0.6,-1.3.") from error
    return np.array([hip, knee])
