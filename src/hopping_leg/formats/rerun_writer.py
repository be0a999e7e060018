"""Traces as rerun recordings: every number over time, and the leg where its height is known."""

from pathlib import Path

import numpy as np
import rerun

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, kinematics
from hopping_leg.trace import Trace

TIMELINE = "time"
LEG = "leg"
"""Entity that holds the links as lines; the others are called as the trace's columns."""


def write_rerun(trace: Trace, robot: Robot | None, path: Path) -> None:
    """Write a trace as an .rrd file; without its robot the leg is not drawn.

    Raises:
        OSError: The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()  # rerun says only that a file cannot be written, not why
    with rerun.RecordingStream("hopping_leg", recording_id=path.stem) as recording:
        recording.save(path)
        time = rerun.TimeColumn(TIMELINE, duration=trace.column("time_s"))
        for name in trace.numbers:
            scalars = rerun.Scalars.columns(scalars=trace.column(name))
            recording.send_columns(name, [time], scalars)
        if robot is not None and np.isfinite(trace.column("height_m")).all():
            recording.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            strips = rerun.LineStrips3D.columns(strips=links(trace, robot))
            recording.send_columns(LEG, [time], strips)


def links(trace: Trace, robot: Robot) -> Array:
    """Return hip axis, knee and foot in the world, (x forward, y, z up), m, (ticks, 3, 3)."""
    q = np.stack([trace.column("hip_position_rad"), trace.column("knee_position_rad")], axis=-1)
    thigh = robot.thigh.length * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], axis=-1)
    points = np.zeros((len(q), 3, 3))
    for point, place in enumerate((np.zeros_like(q), thigh, kinematics.foot_position(robot, q))):
        points[:, point, 0] = place[:, 1]
        points[:, point, 2] = trace.column("height_m") - place[:, 0]
    return points
