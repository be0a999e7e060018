"""What was wrong with a trial: the wire, trace and flight recording are asked one by one."""

import math
import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.hardware_trials import Performance
from hopping_leg.deploy.supervisor import State
from hopping_leg.errors import TraceError
from hopping_leg.flight_recording import SUFFIX, recover
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.trace import Trace
from studies.fault_campaign.case import Result, Scene
from studies.fault_campaign.families import Family
from studies.fault_campaign.verdict import SAFE, problems_of_commands, reaction, restarts
from studies.fault_campaign.wire_log import WireLog

BRAKED_WITHIN = 0.025
"""Time from the host's death within which the drives must brake, s."""

FAR, LIED_WITHIN = 0.05, 0.05
"""Difference of a joint's angle from what its drive says that matters, rad; time for which the
drives may be powered after that, s."""

SHOWS = {"torque_false": ("sent_nm", 2.0), "velocity_false": ("velocity_rad_s", 1.0)}
"""From which value of a column on a kind of lie shows: torque sent, N m, and speed said, rad/s."""

PUSHED = 0.1
"""Share of its largest torque from which on a joint counts as pushed."""


def judge_wire(result: Result, scene: Scene, log: WireLog, modes: Sequence[int]) -> None:
    """Add what was wrong on the wire.

    Args:
        result: To be added to; the mishap has begun.
        scene: Of the trial.
        log: Of the wire.
        modes: Of the drives at the end.
    """
    assert result.began is not None
    result.problems += problems_of_commands(log.commands, scene.limits)
    result.problems += restarts(log.commands, result.began)
    jumped = "encoder_jump" in [fault.kind for fault in scene.mishap.faults[:1]]
    result.reaction = reaction(log, scene.limits, result.began, jumped=jumped)
    if result.reaction is not None and math.isinf(result.reaction):
        result.problems.append("no safe command followed a bad answer")
    if DriveMode.POSITION in modes:
        result.problems.append("a drive is still in torque mode at the end")


def judge_truth(result: Result, scene: Scene, log: WireLog, truth: Array, trace: Trace) -> None:
    """Add what the leg's true state tells of a trial in which a drive lied.

    No joint may stand at its stop while pushed. A lie about positions matters from when an encoder
    is farther from what its drive says than ``FAR``: from then on the drives may be powered for
    ``LIED_WITHIN``. Samples that are old are as false at once, but not for long.

    Args:
        result: To be added to; the mishap has begun.
        scene: Of the trial.
        log: Of the wire.
        truth: Of the leg, as ``Lockstep`` has it, and the angles that honest encoders see, rad.
        trace: Of the run.
    """
    assert result.began is not None
    kinds = {fault.kind for fault in scene.mishap.faults}
    time, true, turned = truth[:, 0], truth[:, 3:5], truth[:, 5:7]
    off = [told.time for told in log.commands if told.mode in SAFE and told.time >= result.began]
    until = min(off, default=math.inf)
    said_at = trace.column("time_s") + time[0]
    for fault in scene.mishap.faults:
        if fault.kind in SHOWS:
            joints = JOINTS if fault.drive == "both" else (fault.drive,)
            column, least = SHOWS[fault.kind]
            values = np.abs([trace.column(f"{name}_{column}") for name in joints]).max(axis=0)
            lying = (said_at >= result.began) & (said_at <= until)
            result.shown = float((lying & (values >= least)).sum() / CONTROL_RATE)
    for joint, name in enumerate(JOINTS):
        model = getattr(scene.robot, name)
        said = trace.column(f"{name}_position_rad")
        where = np.interp(said_at, time, true[:, joint])
        honest = np.interp(said_at, time, turned[:, joint])
        wrong = said_at[(np.abs(honest - said) > FAR) & (said_at >= result.began)]
        if wrong.size and wrong[0] <= until:
            powered = until - wrong[0]
            result.reaction = max(result.reaction or 0.0, powered)
            if powered > LIED_WITHIN and "stale_sample" not in kinds:
                result.problems.append(
                    f"{name}: powered for {powered:.3f} s after its lie mattered"
                )
        pushed = np.abs(trace.column(f"{name}_sent_nm")) > PUSHED * model.torque_limit
        beyond = (where <= model.stop_lower) | (where >= model.stop_upper)
        if (beyond & pushed & (said_at >= result.began) & (said_at <= until)).any():
            result.problems.append(f"{name}: it stood at its stop while it was pushed")


def judge_trace(result: Result, done: Performance, family: Family | None) -> None:
    """Add what the trace tells: the reason, and whether the leg stayed stopped.

    Args:
        result: To be added to.
        done: The run.
        family: Of the mishap; None accepts any reason.
    """
    reasons = family.reasons if family else frozenset()
    cause = done.outcome.supervisor.stop_cause
    result.reason, result.sentence = cause.reason.name, str(cause)
    if reasons and cause.reason not in reasons:
        valid = ", ".join(sorted(reason.name for reason in reasons))
        result.problems.append(f"the reason is {cause.reason.name}, correct were: {valid}")
    told = [event.get("reason") for event in done.trace.header["events"]]
    if cause.reason.name.lower() not in told:
        result.problems.append("the reason is not in the trace")
    if family and family.grounded and np.isfinite(done.trace.column("hip_command_nm")).any():
        result.problems.append("the leg hopped")
    states = done.trace.column("state")
    if (np.diff(states) < 0).any() or states[-1] != State.STOPPED:
        result.problems.append("the supervisor did not stay stopped")


def judge_braking(result: Result, braked: float | None) -> None:
    """Add how long after the host's death the drives brake, s; None if they do not."""
    result.braked = braked
    if braked is None or braked > BRAKED_WITHIN:
        result.problems.append("the drives did not brake in time after the host's death")


def start_host(work: Callable[[], object]) -> int:
    """Return the process of a host that does its work and waits to be killed."""
    child = os.fork()
    if child == 0:
        try:
            work()
            signal.pause()
        finally:
            os._exit(1)
    return child


def problems_of_box(folder: Path) -> list[str]:
    """Return what is wrong with the flight recording of a killed host."""
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
