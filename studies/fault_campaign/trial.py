"""A trial in virtual time: exact, and as fast as the processor."""

import os
import signal
import tempfile
from pathlib import Path

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.emulator.virtual_time import Lockstep
from hopping_leg.errors import HardwareError
from hopping_leg.robot.parameters import Robot
from studies.fault_campaign.case import Case, Result, Scene, words
from studies.fault_campaign.families import Family
from studies.fault_campaign.host import HostDiedError, StruckClock
from studies.fault_campaign.judging import (
    BRAKED_WITHIN,
    judge_trace,
    judge_wire,
    problems_of_box,
)


def play(case: Case, family: Family, robot: Robot) -> Result:
    """Run and judge a trial.

    Args:
        case: Which.
        family: Of its mishap.
        robot: Loaded.
    """
    scene = Scene(case, family, robot)
    result = _refused(scene) if family.refused else _hop(scene)
    if scene.mishap.dies:
        result.problems += _killed(scene)
    return result


def _refused(scene: Scene) -> Result:
    """Ask for arming; it must be refused in a sentence, and nothing may move."""
    result = Result(words(scene.mishap), began=0.0)
    lockstep = Lockstep(scene.start.build(), checksums=scene.checksums)
    try:
        scene.require_fitness(lockstep.link)
        result.problems.append("the drives would have been armed")
    except HardwareError as error:
        result.reason, result.sentence = "NOT_ARMED", str(error)
    finally:
        lockstep.link.close()
    if any(told.mode is not DriveMode.STOPPED for told in lockstep.robot.log.commands):
        result.problems.append("a drive was powered")
    return result


def _hop(scene: Scene) -> Result:
    """Hop until the mishap and beyond."""
    mishap = scene.mishap
    result = Result(words(mishap))
    lockstep = Lockstep(scene.start.build(), checksums=scene.checksums)
    clock = StruckClock(lockstep, mishap.at, stall=mishap.stall, dies=mishap.dies)
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = scene.perform(lockstep.link, Path(folder), clock, realtime=False)
        except HostDiedError:
            done = None
        finally:
            lockstep.link.close()
    faults = lockstep.robot.fault_injector.log
    result.began = faults[0][0] if faults else clock.began
    if result.began is None:
        result.problems.append("the mishap did not happen")
        return result
    modes = [drive.machine.mode for drive in lockstep.robot.drives]
    judge_wire(result, scene, lockstep.robot.log, modes)
    if done is not None:
        judge_trace(result, done, scene.family.reasons)
        return result
    result.braked = clock.braked
    if clock.braked is None or clock.braked > BRAKED_WITHIN:
        result.problems.append("the drives did not brake in time after the host's death")
    return result


def _killed(scene: Scene) -> list[str]:
    """Hop in a process that is killed; return what is wrong with its black box."""
    with tempfile.TemporaryDirectory() as folder:
        child = os.fork()
        if child == 0:
            try:
                lockstep = Lockstep(scene.start.build(), checksums=scene.checksums)
                clock = StruckClock(lockstep, scene.mishap.at, killed_after=scene.killed_after)
                scene.perform(lockstep.link, Path(folder), clock, realtime=False)
                signal.pause()
            finally:
                os._exit(1)
        _, status = os.waitpid(child, 0)
        if not os.WIFSIGNALED(status) or os.WTERMSIG(status) != signal.SIGKILL:
            return ["the host ended before it was killed"]
        return problems_of_box(Path(folder))
