"""What was wrong with a trial: the wire, trace and flight recording are asked one by one."""

import math
import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hopping_leg.deploy.drive_link import DriveMode
from hopping_leg.deploy.flight_recorder import SUFFIX, recover
from hopping_leg.deploy.hardware_trials import Performance
from hopping_leg.deploy.supervisor import State
from hopping_leg.errors import TraceError
from studies.fault_campaign.case import Result, Scene
from studies.fault_campaign.families import Family
from studies.fault_campaign.verdict import problems_of_commands, reaction, restarts
from studies.fault_campaign.wire_log import WireLog

BRAKED_WITHIN = 0.025
"""Time from the host's death within which the drives must brake, s."""


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
    fault = scene.mishap.fault
    jumped = fault is not None and fault.kind == "encoder_jump"
    result.reaction = reaction(log, scene.limits, result.began, jumped=jumped)
    if result.reaction is not None and math.isinf(result.reaction):
        result.problems.append("no safe command followed a bad answer")
    if DriveMode.POSITION in modes:
        result.problems.append("a drive is still in torque mode at the end")


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
