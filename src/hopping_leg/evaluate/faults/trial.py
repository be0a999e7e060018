"""One trial: a leg hops behind the emulated wire, something goes wrong, the outcome is judged."""

import dataclasses
import os
import signal
import tempfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hopping_leg.control.library import load_controller
from hopping_leg.deploy.black_box import SUFFIX, recover
from hopping_leg.deploy.bring_up import judge, require
from hopping_leg.deploy.emulator.codes import Mode
from hopping_leg.deploy.emulator.faults import Fault
from hopping_leg.deploy.emulator.lockstep import Lockstep
from hopping_leg.deploy.emulator.start import Start
from hopping_leg.deploy.envelope import Envelope, hopping_envelope
from hopping_leg.deploy.inspection import inspect
from hopping_leg.deploy.schedule import Schedule
from hopping_leg.deploy.sequence import Sequence, Timing, hopping_poses
from hopping_leg.deploy.session import Performance, header_of, perform
from hopping_leg.deploy.supervisor import State
from hopping_leg.errors import HardwareError, TraceError
from hopping_leg.evaluate.faults.families import Family, Mishap
from hopping_leg.evaluate.faults.host import HostDiedError, StruckClock
from hopping_leg.evaluate.faults.verdict import Limits, problems_of_commands, reaction, restarts
from hopping_leg.robot.limits import SoftLimiter, SoftLimits
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE

HEIGHTS = (0.25, 0.30, 0.35)
"""Commanded heights, m; each trial takes one."""

BRAKED_WITHIN = 0.025
"""Time from the host's death within which the drives must brake, s."""

_TIMING = Timing(hop=0.0, rise=0.3, settle=0.1, sink=0.3, fade=0.1)
_FIRST_HOP = 0.6
"""Time that the first lift-off may take, s."""
_AFTERWARDS = 0.3
"""Hopping after a mishap that may be survived, s."""


@dataclass(frozen=True)
class Case:
    """Which trial.

    Attributes:
        family: Of the mishap.
        controller: Name or file.
        robot: Name or file.
        index: Number of the repeat.
        seed: Of the campaign.
    """

    family: str
    controller: str
    robot: str
    index: int
    seed: int

    @property
    def rng(self) -> np.random.Generator:
        """The trial's own source of randomness: the same mishaps for all controllers."""
        return np.random.default_rng([self.seed, zlib.crc32(self.family.encode()), self.index])


@dataclass
class Result:
    """What became of a trial.

    Attributes:
        what: The mishap in words.
        began: When it began, s; None if it did not.
        reason: For which the run ended.
        sentence: The reason with what was seen.
        reaction: From the first bad answer to the first safe command, s; None without either.
        braked: From the host's death until the drives brake, s.
        problems: What was unsafe or wrong; empty if all is well.
    """

    what: str
    began: float | None = None
    reason: str = ""
    sentence: str = ""
    reaction: float | None = None
    braked: float | None = None
    problems: list[str] = field(default_factory=list)


def play(case: Case, family: Family, robot: Robot) -> Result:
    """Run and judge a trial in virtual time.

    Args:
        case: Which.
        family: Of its mishap.
        robot: Loaded.
    """
    rng = case.rng
    mishap = family.draw(rng)
    start = dataclasses.replace(
        mishap.start or Start(), robot=case.robot, seed=int(rng.integers(1 << 30))
    )
    if mishap.fault is not None:
        start = dataclasses.replace(start, faults=(mishap.fault,))
    trial = _Trial(case, family, robot, mishap, start, rng)
    result = trial.refused() if family.refused else trial.hop()
    if mishap.dies:
        result.problems += trial.killed()
    return result


class _Trial:
    def __init__(
        self,
        case: Case,
        family: Family,
        robot: Robot,
        mishap: Mishap,
        start: Start,
        rng: np.random.Generator,
    ) -> None:
        self._case, self._family, self._robot = case, family, robot
        self._mishap, self._start = mishap, start
        self._envelope: Envelope = hopping_envelope(robot, CONTROL_RATE)
        self._limits = Limits.of(robot, self._envelope)
        self._height = float(rng.choice(HEIGHTS))
        self._checksums = bool(rng.random() < 0.5)
        self._killed_after = float(rng.uniform(0, 0.01))

    def refused(self) -> Result:
        """Ask for arming; it must be refused in a sentence, and nothing may move."""
        result = Result(_words(self._mishap), began=0.0)
        lockstep = Lockstep(self._start.build(), checksums=self._checksums)
        try:
            require(judge(self._robot, self._envelope, inspect(lockstep.link)))
            result.problems.append("the drives would have been armed")
        except HardwareError as error:
            result.reason, result.sentence = "NOT_ARMED", str(error)
        finally:
            lockstep.link.close()
        if any(told.mode not in (Mode.STOPPED, Mode.BRAKE) for told in lockstep.robot.log.commands):
            result.problems.append("a drive was powered")
        return result

    def hop(self) -> Result:
        """Hop until the mishap and beyond."""
        result = Result(_words(self._mishap))
        lockstep = Lockstep(self._start.build(), checksums=self._checksums)
        mishap = self._mishap
        clock = StruckClock(lockstep, mishap.at, stall=mishap.stall, dies=mishap.dies)
        with tempfile.TemporaryDirectory() as folder:
            try:
                done = self._perform(lockstep, clock, Path(folder))
            except HostDiedError:
                done = None
            finally:
                lockstep.link.close()
        log = lockstep.robot.misfortune.log
        result.began = clock.began if mishap.fault is None else log[0][0] if log else None
        if result.began is None:
            result.problems.append("the mishap did not happen")
            return result
        self._judge(result, lockstep)
        if done is not None:
            self._judge_trace(result, done)
        else:
            result.braked = clock.braked
            if clock.braked is None or clock.braked > BRAKED_WITHIN:
                result.problems.append("the drives did not brake in time")
        return result

    def killed(self) -> list[str]:
        """Hop in a process that is killed; return what is wrong with its black box."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder)
            child = os.fork()
            if child == 0:
                try:
                    lockstep = Lockstep(self._start.build(), checksums=self._checksums)
                    after = self._killed_after
                    clock = StruckClock(lockstep, self._mishap.at, killed_after=after)
                    self._perform(lockstep, clock, path)
                    signal.pause()
                finally:
                    os._exit(1)
            _, status = os.waitpid(child, 0)
            if os.WTERMSIG(status) != signal.SIGKILL:
                return ["the host ended before it was killed"]
            return _problems_of_box(path)

    def _perform(self, lockstep: Lockstep, clock: StruckClock, folder: Path) -> Performance:
        controller = load_controller(self._case.controller, self._robot)
        sequence = Sequence(
            controller,
            Schedule(((self._height, 100.0),)),
            hopping_poses(self._robot),
            SoftLimiter(self._robot, SoftLimits()),
            dataclasses.replace(_TIMING, hop=_FIRST_HOP + self._mishap.at + _AFTERWARDS),
        )
        require(judge(self._robot, self._envelope, inspect(lockstep.link)))
        return perform(
            lockstep.link,
            sequence,
            self._envelope,
            folder / "run.parquet",
            header_of(self._robot, controller, CONTROL_RATE),
            clock=clock,
            realtime=False,
        )

    def _judge(self, result: Result, lockstep: Lockstep) -> None:
        """Judge what went over the wire."""
        assert result.began is not None
        robot, log = lockstep.robot, lockstep.robot.log
        result.problems += problems_of_commands(log.commands, self._limits)
        result.problems += restarts(log.commands, result.began)
        fault = self._mishap.fault
        jumped = fault is not None and fault.kind == "encoder_jump"
        result.reaction = reaction(log, self._limits, result.began, jumped=jumped)
        if result.reaction == np.inf:
            result.problems.append("no safe command followed a bad answer")
        if any(drive.machine.mode is Mode.POSITION for drive in robot.drives):
            result.problems.append("a drive is still in torque mode at the end")

    def _judge_trace(self, result: Result, done: Performance) -> None:
        """Judge what the trace tells: the reason, and that it stayed stopped."""
        cause = done.outcome.memory.stop_cause
        result.reason, result.sentence = cause.reason.name, str(cause)
        if cause.reason not in self._family.reasons:
            valid = ", ".join(sorted(reason.name for reason in self._family.reasons))
            result.problems.append(f"the reason is {cause.reason.name}, correct were: {valid}")
        told = [event.get("reason") for event in done.trace.header["events"]]
        if cause.reason.name.lower() not in told:
            result.problems.append("the reason is not in the trace")
        states = done.trace.column("state")
        if (np.diff(states) < 0).any() or states[-1] != State.STOPPED:
            result.problems.append("the supervisor did not stay stopped")


def _problems_of_box(folder: Path) -> list[str]:
    """Return what is wrong with the black box of a killed host."""
    boxes = list(folder.glob(f"*{SUFFIX}"))
    if len(boxes) != 1:
        return [f"there are {len(boxes)} black boxes after kill -9"]
    try:
        trace = recover(boxes[0])
    except TraceError as error:
        return [f"the black box is not readable after kill -9: {error}"]
    problems = []
    if trace.column("state")[-1] != State.RUNNING:
        problems.append("the black box does not reach the hop in which the host was killed")
    steps = np.diff(trace.column("time_s"))
    if not np.isfinite(trace.column("hip_sent_nm")).all() or (steps <= 0).any():
        problems.append("the black box has damaged rows")
    return problems


def _words(mishap: Mishap) -> str:
    if mishap.start is not None:
        faults = ", ".join(map(_of_fault, mishap.start.faults))
        return faults or f"pose {mishap.start.pose}"
    if mishap.fault is not None:
        return f"{_of_fault(mishap.fault)} at {mishap.at:.3f} s"
    if mishap.dies:
        return f"killed at {mishap.at:.3f} s"
    return f"stalled for {mishap.stall:.3f} s at {mishap.at:.3f} s"


def _of_fault(fault: Fault) -> str:
    parts = [fault.kind, fault.drive, fault.name, f"value {fault.amount:.4g}"]
    if fault.count > 1:
        parts.append(f"{fault.count} times")
    return " ".join(part for part in parts if part)
