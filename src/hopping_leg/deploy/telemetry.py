"""A tick as a row of the flight recording: the trace's columns and what only hardware has."""

import math
from collections.abc import Sequence

from hopping_leg.controllers.protocol import Controller
from hopping_leg.deploy.drive_link import DriveCommand, Replies
from hopping_leg.deploy.motion_sequence import SequenceStep
from hopping_leg.deploy.supervisor import SupervisorState
from hopping_leg.robot.parameters import JOINTS

_LOOP = ("time_s", "command_m", "state", "reason", "part", "action")
_TIMES = ("wake_late_s", "exchange_s", "control_s", "tick_s", "skipped_ticks")
_MEASURED = ("position_rad", "velocity_rad_s", "torque_nm")
_DRIVE = ("mode", "fault", "voltage_v", "temperature_c", "fresh")
_ASKED = ("command_nm", "sent_nm")


def columns(controller: Controller) -> tuple[str, ...]:
    """Return the columns of a run; the controller's own come last."""
    drives = tuple(f"{joint}_{name}" for name in (*_MEASURED, *_DRIVE, *_ASKED) for joint in JOINTS)
    return (*_LOOP, *_TIMES, *drives, *internal_names(controller))


def internal_names(controller: Controller) -> tuple[str, ...]:
    """Return the names of a controller's own columns."""
    controller.reset(1)
    return tuple(sorted(controller.internals()))


def row(
    time: float,
    step: SequenceStep,
    state: SupervisorState,
    outgoing: DriveCommand,
    fresh: Replies,
    timings: Sequence[float],
    internals: Sequence[float],
) -> list[float]:
    """Return the row of a tick; measurements are NaN where no fresh reply came.

    Timings are from the deadline to the tick's beginning, from there until the replies were in or
    given up, from there until the torques had left, from the deadline to the end, all in s, and the
    ticks that were left out before this one.
    """
    values: list[float] = [
        time,
        step.command,
        state.state,
        state.cause.reason,
        step.phase,
        outgoing.action.value,
        *timings,
    ]
    last = state.counts.last
    for name in ("position", "velocity", "torque"):
        values += [math.nan if reply is None else getattr(reply, name) for reply in fresh]
    for name in ("mode", "fault", "voltage", "temperature"):
        values += [math.nan if reply is None else getattr(reply, name) for reply in last]
    values += [float(reply is not None) for reply in fresh]
    values += step.controller
    values += outgoing.torque
    values += internals
    return values
