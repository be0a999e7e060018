"""A trial in real time: the host here, the drives in another process, a terminal between them.

It measures what virtual time cannot: how soon after a bad answer the host's computer has sent a
safe command, and how soon after its death the drives brake.
"""

import os
import signal
import tempfile
import time
from pathlib import Path

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.deploy.transport import open_transport
from hopping_leg.errors import TraceError
from hopping_leg.flight_recording import SUFFIX, recover
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.trace import Trace
from studies.fault_campaign.case import Case, Result, Scene, words
from studies.fault_campaign.emulator_process import EmulatorProcess
from studies.fault_campaign.judging import (
    judge_braking,
    judge_trace,
    judge_wire,
    problems_of_box,
    start_host,
)
from studies.fault_campaign.wire_log import WireLog

LIVE = (
    *("encoder jump", "drive fault", "over-temperature", "over-voltage", "under-voltage"),
    *("drive restarted", "killed host"),
)
"""Families that show in an answer, or end the host: what a reaction can be measured of."""

_OF_A_SLOW_COMPUTER = (
    *(Reason.REPLIES_MISSING, Reason.DRIVE_TIMEOUT, Reason.LOOP_OVERRUN, Reason.LOOP_STALLED),
    *(Reason.POSITION_LIMIT, Reason.ARMING_TOOK_TOO_LONG),
)

_PATIENCE = 30.0
"""Longest wait for the first lift-off, s."""
_AFTERWARDS = 0.15
"""How long the drives are watched after the host's death, s."""


def play_live(case: Case) -> Result:
    """Run and judge a trial of a family of ``LIVE``; a signal raises ``KeyboardInterrupt``."""
    scene = Scene(case)
    with EmulatorProcess(scene.start) as emulator, tempfile.TemporaryDirectory() as folder:
        if scene.mishap.dies:
            return _killed(scene, emulator, Path(folder))
        return _hop(scene, emulator, Path(folder))


def _hop(scene: Scene, emulator: EmulatorProcess, folder: Path) -> Result:
    result = Result(words(scene.mishap))
    link = MoteusLink(scene.robot, open_transport(str(emulator.path)))
    try:
        done = scene.perform(link, folder)
    finally:
        link.close()
    log, state = emulator.log(), emulator.state()
    reason = done.outcome.supervisor.stop_cause.reason
    result.disturbed = not state.faults or (
        reason in _OF_A_SLOW_COMPUTER and reason not in scene.family.reasons
    )
    powered = (told.time for told in log.commands if told.mode is DriveMode.POSITION)
    result.began = state.faults[0][0] if state.faults else next(powered, 0.0)
    judge_wire(result, scene, log, state.modes)
    judge_trace(result, done, None if result.disturbed else scene.family)
    return result


def _killed(scene: Scene, emulator: EmulatorProcess, folder: Path) -> Result:
    """Let a process drive the leg and kill it at a moment of the hop."""
    result = Result(words(scene.mishap))

    def hop() -> None:
        scene.perform(MoteusLink(scene.robot, open_transport(str(emulator.path))), folder)

    child = start_host(hop)
    try:
        if not _flown(emulator, scene.mishap.at):
            result.disturbed = True
            return result
        result.began = emulator.state().time
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if gave_up(folder):
        result.disturbed = True
        return result
    time.sleep(_AFTERWARDS)
    log = emulator.log()
    result.began = max(result.began, log.commands[-1].time)  # it may have sent one since
    judge_braking(result, _braked(log, result.began))
    result.problems += problems_of_box(folder)
    return result


def gave_up(folder: Path) -> bool:
    """Tell whether the host had stopped the leg before it died, as the computer was too slow."""
    slow = {reason.name.lower() for reason in _OF_A_SLOW_COMPUTER}
    try:
        traces = [Trace.load(file) for file in folder.glob("*.parquet")]
        traces += [recover(file) for file in folder.glob(f"*{SUFFIX}")]
    except TraceError:
        return False
    return any(event.get("reason") in slow for t in traces for event in t.header["events"])


def _flown(emulator: EmulatorProcess, seconds: float) -> bool:
    """Wait until so long after the first lift-off; return whether there was one."""
    until = time.monotonic() + _PATIENCE
    while time.monotonic() < until:
        state = emulator.state()
        if state.time >= state.flown + seconds:
            return True
        time.sleep(0.002)
    return False


def _braked(log: WireLog, death: float) -> float | None:
    """Return the time from the host's death until both drives have left torque mode, s."""
    left: dict[int, float] = {}
    for moment, joint, mode in log.changes:
        if moment >= death and mode is not DriveMode.POSITION:
            left.setdefault(joint, moment - death)
    return max(left.values()) if len(left) == len(JOINTS) else None
