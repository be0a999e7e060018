"""A trial in virtual time, exact and as fast as the processor; its host may stand still or die."""

import os
import signal
import tempfile
import threading
from pathlib import Path

import numpy as np

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.emulator.drive import EmulatedDrive
from hopping_leg.emulator.leg import TIMESTEP
from hopping_leg.emulator.mode_machine import CONTROLLING
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError
from studies.fault_campaign.case import Case, Result, Scene, words
from studies.fault_campaign.judging import (
    judge_braking,
    judge_trace,
    judge_truth,
    judge_wire,
    problems_of_box,
    start_host,
)
from studies.fault_campaign.wire_log import WireLog

_WATCHED = 0.1
"""How long the drives are watched after the host's death, s."""


class HostDiedError(Exception):
    """The host is dead and the drives have been watched."""


class StruckClock:
    """A lockstep clock of a host that is struck by its mishap after the first lift-off.

    Attributes:
        began: When it was struck, s.
        braked: From the host's death until both drives brake, s; None if a drive does not.
        turned: Joint angles that honest encoders see, ahead of the transmissions, at every tick of
            the lockstep's truth, rad.
    """

    def __init__(self, lockstep: Lockstep, scene: Scene, *, killed: bool = False) -> None:
        """Strike it once; if it is to be killed, the process really is, else it is watched."""
        self._lockstep, self._mishap = lockstep, scene.mishap
        self._killed_after = scene.killed_after if killed else None
        self.began: float | None = None
        self.braked: float | None = None
        self.turned: list[list[float]] = []

    def now(self) -> float:
        """Return the robot's time."""
        return self._lockstep.now()

    def wait_until(self, deadline: float) -> float:
        """Let the robot move until a deadline, unless the host is struck.

        Raises:
            HostDiedError: It died.
        """
        robot, mishap = self._lockstep.robot, self._mishap
        due = deadline >= robot.fault_injector.flown + mishap.at
        if (mishap.stall or mishap.dies) and self.began is None and due:
            self.began = robot.time
            if self._killed_after is not None:
                threading.Timer(self._killed_after, os.kill, (os.getpid(), signal.SIGKILL)).start()
            elif mishap.dies:
                self.braked = self._watch()
                raise HostDiedError
            deadline += mishap.stall
        reached, leg = self._lockstep.wait_until(deadline), robot.leg
        seen = [
            wire.joint_position(leg.sensed(k)[0]) / leg.wiring[k]
            for k, wire in enumerate(leg.transforms)
        ]
        self.turned.append(seen)
        return reached

    def _watch(self) -> float | None:
        """Let the robot move without a host; return when both drives have begun to brake."""
        robot = self._lockstep.robot
        begin = robot.time
        braked = None
        while robot.time < begin + _WATCHED:
            if braked is None and all(_braking(drive) for drive in robot.drives):
                braked = robot.time - begin
            robot.advance(robot.time + TIMESTEP)
        return braked


def _braking(drive: EmulatedDrive) -> bool:
    """Whether a drive brakes by itself, or has no power on its windings."""
    machine, settings = drive.machine, drive.settings
    if machine.mode is DriveMode.TIMEOUT:
        return int(settings["servo.timeout_mode"]) == DriveMode.BRAKE
    return machine.mode is DriveMode.BRAKE or machine.mode not in CONTROLLING


def play(case: Case) -> Result:
    """Run and judge a trial."""
    scene = Scene(case)
    try:
        result = _refused(scene) if scene.family.refused else _hop(scene)
    except HardwareError:
        if not scene.family.grounded:
            raise
        result = _refused(scene)  # by where its joints stand, as they are wired
    if scene.mishap.dies:
        result.problems += _killed(scene)
    return result


def _logged(scene: Scene) -> tuple[Lockstep, WireLog]:
    """Return the robot of a trial and the log of its wire."""
    lockstep, log = Lockstep(scene.emulate(), checksums=scene.checksums), WireLog()
    lockstep.robot.on_message, lockstep.robot.on_mode = log.record, log.record_mode
    return lockstep, log


def _refused(scene: Scene) -> Result:
    """Ask for arming; it must be refused in a sentence, and nothing may move."""
    result = Result(words(scene.mishap), began=0.0)
    lockstep, log = _logged(scene)
    try:
        scene.require_fitness(lockstep.link)
        result.problems.append("the drives would have been armed")
    except HardwareError as error:
        result.reason, result.sentence = "NOT_ARMED", str(error)
    finally:
        lockstep.link.close()
    if any(told.mode is not DriveMode.STOPPED for told in log.commands):
        result.problems.append("a drive was powered")
    return result


def _hop(scene: Scene) -> Result:
    """Hop until the mishap and beyond."""
    mishap = scene.mishap
    result = Result(words(mishap))
    lockstep, log = _logged(scene)
    clock = StruckClock(lockstep, scene)
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = scene.perform(lockstep.link, Path(folder), clock)
        except HostDiedError:
            done = None
        finally:
            lockstep.link.close()
    injector = lockstep.robot.fault_injector
    result.began = injector.log[0][0] if injector.log else clock.began
    if mishap.start is not None or mishap.health is not None:
        result.began = injector.powered
    if result.began is None:
        result.problems.append("the mishap did not happen")
        return result
    modes = [drive.machine.mode for drive in lockstep.robot.drives]
    judge_wire(result, scene, log, modes)
    if done is not None:
        judge_trace(result, done, scene.family)
        if scene.family.lies:
            truth = np.column_stack([lockstep.truth, clock.turned])
            judge_truth(result, scene, log, truth, done.trace)
        return result
    judge_braking(result, clock.braked)
    return result


def _killed(scene: Scene) -> list[str]:
    """Hop in a process that is killed; return what is wrong with its black box."""

    def hop() -> None:
        lockstep = Lockstep(scene.start.build(), checksums=scene.checksums)
        scene.perform(lockstep.link, Path(folder), StruckClock(lockstep, scene, killed=True))

    with tempfile.TemporaryDirectory() as folder:
        _, status = os.waitpid(start_host(hop), 0)
        if not os.WIFSIGNALED(status) or os.WTERMSIG(status) != signal.SIGKILL:
            return ["the host ended before it was killed"]
        return problems_of_box(Path(folder))
