"""What a person sees of a running emulation: a line that is renewed, and events that stay."""

import math

from hopping_leg.deploy.joint_transform import JOINTS
from hopping_leg.emulator.drive import Drive
from hopping_leg.emulator.faults import KINDS
from hopping_leg.emulator.moteus_codes import FaultCode, MoteusMode, Notice
from hopping_leg.emulator.robot import EmulatedRobot


def status_line(robot: EmulatedRobot, lost: float) -> str:
    """Return the state in one line.

    Args:
        robot: That is emulated.
        lost: Time that could not be simulated, s.
    """
    parts = [f"{robot.time:7.1f} s"]
    for joint, (name, drive) in enumerate(zip(JOINTS, robot.drives, strict=True)):
        transform = robot.leg.transforms[joint]
        _, _, torque = robot.leg.sensed(joint)
        given = transform.joint_torque(torque) if drive.active else 0.0
        angle = math.degrees(robot.leg.q[joint])
        parts.append(f"{name} {mode_text(drive):<12} {angle:+7.1f} deg {given:+6.2f} N m")
    held = " held" if robot.held else ""
    parts.append(f"height {robot.leg.height:.3f} m{held}")
    if lost > 0.1:
        parts.append(f"{lost:.1f} s lost: the computer is too busy")
    return " | ".join(parts)


def mode_text(drive: Drive) -> str:
    """Return a drive's mode, with its fault or notice."""
    mode, code = drive.machine.mode, drive.machine.fault
    text = MoteusMode(mode).name.lower().replace("_", " ")
    return f"{text} {code}" if code else text


def code_text(code: int) -> str:
    """Return what a fault code or notice means."""
    for kind in (FaultCode, Notice):
        if code in set(kind):
            return kind(code).name.lower().replace("_", " ")
    return "unknown"


class Events:
    """Tells each change of a drive's mode and each fault that begins, once.

    Args:
        robot: That is watched.
    """

    def __init__(self, robot: EmulatedRobot) -> None:
        self._robot = robot
        self._modes = [drive.machine.mode for drive in robot.drives]
        self._told = 0

    def news(self) -> list[str]:
        """Return a line for all that happened since the last call."""
        robot = self._robot
        lines = []
        for time, fault in robot.fault_injector.log[self._told :]:
            who = "" if fault.kind == "unplug" else f" ({fault.drive})"
            lines.append(f"{time:7.3f} s  fault: {KINDS[fault.kind].text}{who}")
        self._told = len(robot.fault_injector.log)
        for joint, drive in enumerate(robot.drives):
            mode = drive.machine.mode
            if mode is not self._modes[joint]:
                self._modes[joint] = mode
                code = drive.machine.fault
                why = f": {code_text(code)}" if mode is MoteusMode.FAULT else ""
                lines.append(f"{robot.time:7.3f} s  {JOINTS[joint]}: {mode_text(drive)}{why}")
        return lines
