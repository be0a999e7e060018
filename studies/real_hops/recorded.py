"""Hops of the lab's legs, cut from its recordings, with the law that commanded them.

On the booms the log gives the whole law: a constant force on the foot through the Jacobian's
transpose until the leg is long enough, then a PD towards one posture, all from the row before. On
the rail the PD of the flight is that of the lab's script; that of the push is not what the motors
gave, so that there is no law of the push.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hopping_leg.arrays import Array, BoolArray, IntArray
from hopping_leg.errors import UsageError
from hopping_leg.identify.recording import Recording, load_recording
from hopping_leg.robot import Boom, Robot, kinematics, load_robot


@dataclass(frozen=True)
class Rig:
    """How one set of recordings was made."""

    folder: str
    files: str
    """Which of its recordings hold torques."""
    robot: str
    """Whose lengths the controller took, but for the shank's."""
    shank: float
    """m"""
    stiffness: tuple[float, float]
    """Of the flight's PD at the joints, N m/rad."""
    damping: tuple[float, float]
    """N m s/rad"""
    limit: float = np.inf
    """Largest push of the knee's drive behind the belt, N m: beyond it both torques shrink."""


RIGS = {
    "boom, 130 Hz": Rig("legv2_boom", "*torque*.csv.gz", "legv2", 0.14, (2.0, 4.0), (0.2, 0.4)),
    "boom, 200 Hz": Rig("legv2_boom_200hz", "*/", "legv2", 0.15, (3.0, 6.0), (0.3, 0.6), 20.0),
    "rail": Rig("legv1_rail", "*.csv.gz", "legv1", 0.2, (50.0, 50.0), (2.0, 2.0)),
}
_LENGTHS = {"es_cmd0.4m": 0.361, "hopping": 0.3236}  # of the leg at lift-off on the rail, m
_JUMP = 2.0  # rad/s, that a joint in the air does not have once its swing has ended
_SWING = {"boom": 0.25, "rail": 0.15}  # s, after which it has
_LATE = 5  # rows by which the boom's controller feels the ground late at most
_GAP = 0.02  # s, that no two rows of a push may lie apart
_SWEEP = 20  # rows over which the target of a flight's PD is looked for


@dataclass(frozen=True)
class Hop:
    """A push-off and its flight; rows are those of the log."""

    run: str
    rig: str
    """Of ``RIGS``."""
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
    rise: Array
    """Of the base since the push-off began, m, (rows,); NaN where none was measured."""
    boom: Boom
    """What carried the leg; neutral on the rail."""


def load_hops(folder: Path, rig: str) -> list[Hop]:
    """Return the hops of a rig's runs that hold torques.

    Raises:
        UsageError: The folder holds no recording of the rig.
    """
    paths = sorted((folder / RIGS[rig].folder).glob(RIGS[rig].files))
    if not paths:
        raise UsageError(f"{folder} has no recordings in its folder {RIGS[rig].folder}.")
    return [hop for path in paths for hop in hops_of(load_recording(path), rig)]


def hops_of(run: Recording, rig: str) -> Iterator[Hop]:
    """Yield a run's hops whose touchdown was recorded, and whose push has no gap."""
    q, qd, time = run.array("position"), run.array("velocity"), run.time
    command, torque = run.array("torque_command"), run.array("torque")
    rise = np.full(len(run), np.nan)
    for name in ("base_rise_m", "height_m"):
        if run.has_column(name):
            rise = run.trace.column(name)
    for start, lift_off, touchdown in _rows(run):
        if np.diff(time[start - 1 : lift_off + _LATE]).max() > _GAP:
            continue
        rows = slice(start, touchdown + 1)
        target, length = run.array("position_command")[lift_off], 0.0
        if run.metadata.rig == "boom":  # tau = Kp (q* - q) - Kd qd of the row before
            stiffness, damping = np.array(RIGS[rig].stiffness), np.array(RIGS[rig].damping)
            later = np.arange(lift_off + 2, lift_off + 2 + _SWEEP)
            wanted = (command[later] + damping * qd[later - 1]) / stiffness + q[later - 1]
            target = np.median(wanted, axis=0)
            if (np.abs(target) > np.pi).any():  # a somersault
                continue
            length = 0.2 if rig == "boom, 130 Hz" else 0.19
        else:
            length = next(value for name, value in _LENGTHS.items() if run.name.startswith(name))
        yield Hop(
            run.name, rig, time[rows] - time[start], q[rows], qd[rows], torque[rows],
            command[rows], target, length, lift_off - start, rise[rows] - rise[start],
            run.metadata.boom,
        )  # fmt: skip


def _rows(run: Recording) -> Iterator[tuple[int, int, int]]:
    """Yield the rows at which pushes begin, flights begin and the ground is felt."""
    if run.metadata.rig == "boom":
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
        swung = run.time > run.time[lift_off] + _SWING[run.metadata.rig]
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
    robot = load_robot(RIGS[rig].robot)
    return replace(robot, shank=replace(robot.shank, length=RIGS[rig].shank, extent=0.2))
