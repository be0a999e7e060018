"""What was unsafe about a trial, judged by what went over the wire and what the trace says."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import takewhile

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.safety_limits import SafetyLimits
from hopping_leg.robot.parameters import Robot
from studies.fault_campaign.wire_log import CommandEvent, ReplyEvent, WireLog

SAFE = (DriveMode.STOPPED, DriveMode.BRAKE)
"""Commands that cannot move the leg."""

_ROUNDING = 1e-5
"""Torques travel as 32-bit floats, N m."""


@dataclass(frozen=True)
class Limits:
    """What may be commanded to each motor, N m at its output, and which answers are good ones."""

    torque: tuple[float, float]
    voltage: tuple[float, float]
    temperature: float

    @staticmethod
    def of(robot: Robot, envelope: SafetyLimits) -> "Limits":
        """Return the limits of a robot."""
        motors = robot.hip.motor.torque_limit, robot.knee.motor.torque_limit
        voltage = envelope.voltage_low, envelope.voltage_high
        return Limits(motors, voltage, envelope.temperature)

    def bad(self, answer: ReplyEvent) -> bool:
        """Tell whether an answer shows by itself that something is wrong."""
        low, high = self.voltage
        healthy = answer.mode is DriveMode.POSITION
        healthy &= low <= answer.voltage <= high and answer.temperature <= self.temperature
        return not healthy


def problems_of_commands(commands: Iterable[CommandEvent], limits: Limits) -> list[str]:
    """Return what was wrong with commands: torque that is no number, or beyond the limits."""
    problems = []
    for told in commands:
        if not math.isfinite(told.torque) or not math.isfinite(told.most):
            problems.append(f"torque that is no number on the wire at {told.time:.4f} s")
        limit = limits.torque[told.joint] + _ROUNDING
        if abs(told.torque) > limit or told.most > limit:
            problems.append(
                f"torque {told.torque:.3f} (most {told.most:.3f}) N m on the wire at"
                f" {told.time:.4f} s, limit {limit:.3f}"
            )
    return problems[:3]


def restarts(commands: Iterable[CommandEvent], since: float) -> list[str]:
    """Return whether torque was commanded again after a stop, from a time on."""
    stopped = False
    for told in commands:
        if told.time < since:
            continue
        if told.mode in SAFE:
            stopped = True
        elif stopped:
            return [f"torque commanded again at {told.time:.4f} s, after a stop"]
    return []


def reaction(log: WireLog, limits: Limits, since: float, *, jumped: bool) -> float | None:
    """Return the time from the first bad answer to the first safe command, s.

    None where the host had no bad answer to react to, infinite where it did not react.

    Args:
        log: Of the wire.
        limits: Which answers are good ones.
        since: When the fault began, s; an answer that left at this very time knows nothing of it.
        jumped: Whether every answer after that is bad, as positions are wrong.
    """
    safe = (told.time for told in log.commands if told.time >= since and told.mode in SAFE)
    done = next(safe, math.inf)
    before = takewhile(lambda answer: answer.time < done, log.answers(since))
    bad = (a.time for a in before if a.time > since and (jumped or limits.bad(a)))
    seen = next(bad, None)
    return None if seen is None else done - seen
