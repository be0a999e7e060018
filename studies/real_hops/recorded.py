"""Hops of the lab's legs, cut from its recordings, with the law that commanded them.

On the boom the log gives the whole law: a constant force on the foot through the Jacobian's
transpose until the leg is ``LENGTHS`` long, then a PD towards one posture. On the rail a push ends
at one length, too, and the PD of the flight is that of the lab's script; that of the push is not
what the motors gave, so that their measured torques stand for it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.robot import Robot, kinematics, load_robot

RIGS = {"boom": ("legv2_boom", "*torque*"), "rail": ("legv1_rail", "*")}
"""Folder of each rig's recordings and which of them hold torques."""
ROBOTS = {"boom": "legv2", "rail": "legv1"}
"""Whose lengths the controllers took."""
FLIGHT_GAINS = 50.0, 2.0
"""Stiffness and damping of both motors on the rail, N m/rad and N m s/rad."""
LENGTHS = {
    "full_run": 0.2,
    "one_hurdle": 0.2,
    "self_short": 0.2,
    "es_cmd0.4m": 0.361,
    "hopping": 0.3236,
}
"""From where on a leg flies by its law, by how a recording's name begins, m."""
_JUMP = 2.0  # rad/s, that a joint in the air does not have once its swing has ended
_SWING = {"boom": 0.25, "rail": 0.15}  # s, after which it has
_LATE = 5  # rows by which the boom's controller feels the ground late at most


@dataclass(frozen=True)
class Hop:
    """A push-off and its flight; rows are those of the log."""

    run: str
    rig: str
    time: Array
    """Since the push-off began, s, (rows,)."""
    q: Array
    """Measured, rad, (rows, 2)."""
    qd: Array
    """rad/s"""
    torque: Array
    """Measured, N m, (rows, 2)."""
    command: Array
    """Torque or, on the rail, feed-forward that was logged, N m, (rows, 2)."""
    target: Array
    """Of the flight's PD, rad, (2,)."""
    length: float
    """Of the leg, from where on it flies by its law, m."""
    lift_off: int
    """First row of that."""
    touchdown: int
    """Row in which the ground was felt; the last one."""
    rise: Array
    """Of the base since the push-off began, m, (rows,); NaN on the rail."""


def load_hops(folder: Path, rig: str) -> list[Hop]:
    """Return the hops of all runs on a rig.

    Raises:
        UsageError: The folder holds no recording of the rig.
    """
    return [hop for run in load_runs(folder, rig) for hop in hops_of(run, rig)]


def load_runs(folder: Path, rig: str) -> list[Recording]:
    """Return a rig's recordings that hold torques."""
    name, pattern = RIGS[rig]
    runs = [load_recording(path) for path in sorted((folder / name).glob(f"{pattern}.csv.gz"))]
    if not runs:
        raise UsageError(f"{folder} has no recordings in its folder {name}.")
    return runs


def hops_of(run: Recording, rig: str) -> Iterator[Hop]:
    """Yield a run's hops whose touchdown was recorded."""
    q, qd, time = run.array("position"), run.array("velocity"), run.time
    rise = np.full(len(run), np.nan)
    if run.has_column("base_rise_m"):
        rise = run.trace.column("base_rise_m")
    for start, lift_off, touchdown in _rows(run, rig):
        rows = slice(start, touchdown + 1)
        command = run.array("torque_command")[rows]
        target = run.array("position_command")[lift_off]
        if rig == "boom":  # tau = 2 (q* - q) - 0.2 qd of the row before
            later = np.arange(lift_off + 2, lift_off + 22)
            target = np.median(
                (run.array("torque_command")[later] + 0.2 * qd[later - 1]) / 2 + q[later - 1],
                axis=0,
            )
            if (np.abs(target) > np.pi).any():  # a somersault
                continue
        yield Hop(
            run.name, rig, time[rows] - time[start], q[rows], qd[rows], run.array("torque")[rows],
            command, target, _length(run), lift_off - start, touchdown - start,
            rise[rows] - rise[start],
        )  # fmt: skip


def _length(run: Recording) -> float:
    return next(value for name, value in LENGTHS.items() if run.name.startswith(name))


def _rows(run: Recording, rig: str) -> Iterator[tuple[int, int, int]]:
    """Yield the rows at which pushes begin, flights begin and the ground is felt."""
    if rig == "boom":
        phase = run.trace.table["phase"].fill_null("").to_numpy()
        pushes, flights = phase == "EXERTION", phase == "FLIGHT"
    else:
        target = run.array("position_command")[:, 0]
        pushes = target < target.mean()
        flights = ~pushes
    speed = np.abs(run.array("velocity")).max(axis=1)
    ends = np.append(_begins(~flights), len(run)) + _LATE
    for start in _begins(pushes):
        (lift_off,) = _begins(flights)[_begins(flights) > start][:1]
        swung = run.time > run.time[lift_off] + _SWING[rig]
        felt = np.flatnonzero((speed > _JUMP) & swung)
        if len(felt) and felt[0] < ends[ends > lift_off][0]:
            yield int(start), int(lift_off), int(felt[0])


def _begins(flags: BoolArray) -> IntArray:
    return np.flatnonzero(flags[1:] & ~flags[:-1]) + 1


def force_of(robot: Robot, q: Array, torque: Array) -> Array:
    """Return the force on the foot, down and forward, N, that torques make, (..., 2)."""
    turned = np.swapaxes(kinematics.jacobian(robot, q), -1, -2)
    return np.asarray(np.linalg.solve(turned, torque[..., None])[..., 0], np.float64)


def controllers_robot(rig: str) -> Robot:
    """Return the robot whose lengths a rig's controller took."""
    return load_robot(ROBOTS[rig])
