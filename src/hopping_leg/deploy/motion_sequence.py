"""What the leg does while it is armed: rise to the start pose, squat, hop, sink down.

Rising and sinking are minimum-jerk paths under the joint PD; the rise begins where the leg is, and
the gains fade out before its end. The paper's soft limits stay in force throughout.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import command_schedule, joint_pd, protocol
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.deploy import keyboard
from hopping_leg.deploy.drive_link import Pair
from hopping_leg.deploy.standing_check import Squat, SquatFindings
from hopping_leg.robot import Robot, kinematics

_ROUNDING = 1e-6  # Rounding of tick times, s; far less than a tick


class Part(IntEnum):
    """Part of the sequence."""

    WAIT = 0
    RISE = 1
    SETTLE = 2
    HOP = 3
    SINK = 4
    DONE = 5
    SQUAT = 6


@dataclass(frozen=True)
class SequenceTiming:
    """How long each part lasts, s."""

    hop: float = 10.0
    rise: float = 2.0
    squat: float = 0.8
    settle: float = 0.5
    sink: float = 1.5
    fade: float = 0.3
    """Fading of the gains at the end of the sinking."""

    def phase(self, elapsed: float) -> tuple[Part, float]:
        """Return the part at a time since the start, and how long it has lasted."""
        for phase, seconds in (
            (Part.RISE, self.rise),
            (Part.SQUAT, self.squat),
            (Part.SETTLE, self.settle),
            (Part.HOP, self.hop),
            (Part.SINK, self.sink),
        ):
            if elapsed < seconds - _ROUNDING:
                return phase, elapsed
            elapsed -= seconds
        return Part.DONE, elapsed


@dataclass(frozen=True)
class Poses:
    """Where the sequence leads, rad, (2,) each: to the first hop, and down before it brakes."""

    start: Array
    rest: Array


_SUNK = 0.1
"""Angle from the rest posture at which a leg whose torques fade has let go of it, rad: from there
the braking drives let it down, more slowly than its friction would."""


def hopping_poses(robot: Robot) -> Poses:
    """Return the standing start of the simulated trials, and a leg nearly folded, foot below."""
    folded = kinematics.foot_position(robot, np.array([robot.hip.upper, robot.knee.lower]))
    length = 1.05 * float(np.hypot(*folded))
    rest = kinematics.joint_angles(robot, np.array([length, 0.0]))
    return Poses(RolloutConfig(robot).start_posture, rest)


@dataclass(frozen=True)
class SequenceStep:
    """What the sequence asks for at a tick: joint torques, N m, and the desired height, m."""

    torque: Pair
    command: float
    phase: Part
    controller: Pair = (np.nan, np.nan)
    """What the controller alone asked for, N m; NaN outside of the hop."""
    trouble: str = ""
    """Why the leg must not go on; empty if it may."""


@dataclass
class MotionSequence:
    """Runs from the moment that the drives follow torques; steps once a tick.

    A ``limiter`` of None goes without soft limits. The gains are of rising and sinking. ``checked``
    is the robot as which the leg must stand and squat before it hops, see ``standing_check``; None
    does not look, as for a leg whose foot is off the ground. ``report`` is called with what the
    squat looked like.
    """

    controller: protocol.Controller
    commands: command_schedule.CommandSchedule | keyboard.LiveHeight
    poses: Poses
    limiter: protocol.SoftLimiter | None
    timing: SequenceTiming = field(default_factory=SequenceTiming)
    gains: joint_pd.JointGains = field(default_factory=joint_pd.JointGains)
    checked: Robot | None = None
    report: Callable[[SquatFindings], None] = lambda _: None

    def __post_init__(self) -> None:
        self._squat: Squat | None = None
        if self.checked is None:
            self.timing = replace(self.timing, squat=0.0)
        else:
            self._squat = Squat(self.checked, self.poses.start, self.gains, self.timing.squat)
        self._began: float | None = None
        self._from, self._phase = np.zeros(2), Part.WAIT
        self.controller.reset(1)

    @property
    def finished(self) -> bool:
        """Whether the leg has sunk down."""
        return self._phase is Part.DONE

    def begin(self, time: float, q: Array) -> None:
        """Start to rise at a time, s, from measured joint angles, rad, (2,)."""
        self._began, self._from = time, q.copy()

    def step(self, time: float, measurement: protocol.Measurement | None) -> SequenceStep:
        """Return what to do at a tick; ``measurement`` is None as long as there is none."""
        if self._began is None or measurement is None:
            return SequenceStep((0.0, 0.0), self.commands.at(0.0), Part.WAIT)
        phase, lasted = self.timing.phase(time - self._began)
        q, qd = measurement.q[0, 0], measurement.qd[0, 0]
        fading = phase is Part.SINK and lasted > self.timing.sink - self.timing.fade
        if self.finished or (fading and np.abs(q - self.poses.rest).max() > _SUNK):
            phase = Part.DONE
        if phase is not self._phase and phase in (Part.SINK, Part.DONE):
            self._from = q.copy()
        if self._squat is not None and self._phase is Part.SQUAT and phase is not Part.SQUAT:
            findings = self._squat.findings()
            self.report(findings)
            if trouble := findings.complaint(self._squat.robot):
                return SequenceStep((0.0, 0.0), self.command(time), phase, trouble=trouble)
        if phase is Part.HOP and self._phase is not Part.HOP:
            self.controller.reset(1)
        self._phase = phase
        command = self.command(time)
        # before the controller acts, which may change what it is given
        samples = np.concatenate([measurement.q, measurement.qd], axis=2)
        if phase is Part.HOP:
            asked = self.controller.act(measurement)[0]
        else:
            asked = self._hold(phase, lasted, q, qd)
        torque = asked
        if self.limiter is not None:
            torque = asked + self.limiter.added(asked[None], samples)[0]
        own = _pair(asked) if phase is Part.HOP else (np.nan, np.nan)
        return SequenceStep(_pair(torque), command, phase, own)

    def command(self, time: float) -> float:
        """Return the height commanded at a time, m."""
        if self._began is None:
            return self.commands.at(0.0)
        before = self.timing.rise + self.timing.squat + self.timing.settle
        return self.commands.at(max(time - self._began - before, 0.0))

    def _hold(self, phase: Part, lasted: float, q: Array, qd: Array) -> Array:
        """Return the torque of rising, squatting, standing or sinking."""
        timing, gains = self.timing, self.gains
        if phase is Part.SQUAT and self._squat is not None:
            return self._squat.torque(lasted, q, qd)
        if phase is Part.DONE:
            return np.zeros(2)
        goal, way, strength = self.poses.start, 1.0, 1.0
        if phase is Part.RISE:
            way = lasted / timing.rise
        elif phase is Part.SINK:
            goal, way = self.poses.rest, lasted / (timing.sink - timing.fade)
            strength = min((timing.sink - lasted) / timing.fade, 1.0)
        target = self._from + (goal - self._from) * kinematics.smooth_step(np.array(way))
        torque: Array = strength * np.array(gains.stiffness) * (target - q)
        return torque - np.array(gains.damping) * qd


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])
