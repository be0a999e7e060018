"""The leg on its rig as a MuJoCo model, and the actuators of many simulations, a row each."""

from collections.abc import Sequence

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.identify import parameters, recording_format
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import GRAVITY, Robot, get_spec

_PARTS = {
    "actuator": ("biasprm", "forcerange"),
    "body": ("inertia", "invweight0", "ipos", "mass", "pos", "subtreemass"),
    "dof": ("M0", "armature", "damping", "frictionloss", "invweight0"),
    "geom": ("friction", "pos", "rbound", "size", "solref"),
}
FIELDS = [f"{part}_{name}" for part, names in _PARTS.items() for name in names] + ["opt.gravity"]
"""Fields of a model in which hypotheses may differ, as ``Batch.expand`` knows them."""


def build_rig_model(
    robot: Robot, rig: recording_format.Rig, timestep: float, gravity: float = GRAVITY
) -> mujoco.MjModel:
    """Compile a robot on its rig; a fixed base has no rail joint and touches nothing.

    An actuator's force is ``ctrl - kp q - kd qd`` at the joint, bounded by its force range; the
    gains stand in ``biasprm`` and are zero here. So a drive's own loop acts at every physics step
    if ``ctrl = kp q* + kd qd* + feed-forward``.

    The timestep is in s, gravity is the acceleration of the base in free flight, m/s2. RobotError
    says that MuJoCo refuses the parameters.
    """
    fixed = rig == "fixed-base"
    spec = get_spec(robot, timestep, fixed_base=fixed)
    spec.option.gravity = [0, 0, -gravity]
    # A simulation that breaks down must not go on from a default state unnoticed.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # One leg is one island; to look for others takes a tenth of a step.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    for geom in list(spec.geoms):
        geom.material = ""
        if fixed or not (geom.contype or geom.conaffinity):
            spec.delete(geom)
    for visual in (*list(spec.materials), *list(spec.textures)):
        spec.delete(visual)
    for actuator in spec.actuators:
        actuator.ctrllimited = False
        actuator.gear[0] = 1
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.forcelimited = True
        actuator.forcerange = [-1e9, 1e9]
    try:
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise RobotError(f"MuJoCo cannot build robot '{robot.name}': {reason}.") from error


def drive_values(hypotheses: Sequence[parameters.LegHypothesis], name: str) -> Array:
    """Return an attribute of both drives, (hypotheses, 2)."""
    return np.array([[getattr(h.drive.hip, name), getattr(h.drive.knee, name)] for h in hypotheses])


def recorded_gains(recording: Recording, name: str) -> Array:
    """Return a gain of the on-board PD, (rows, 2), NaN if unknown; rows win over the metadata."""
    pair = getattr(recording.metadata, name)
    if name == "integral":
        return np.tile(pair or (0.0, 0.0), (len(recording), 1))
    rows = recording.array(name)
    return np.where(np.isnan(rows), pair or (np.nan, np.nan), rows)


class MotorBounds:
    """Smallest and largest torque of each joint at its speed, as ``robot.limits.MotorLimit``.

    There is a recording per window; a limit in its metadata replaces the robot's software limit.
    """

    def __init__(
        self, hypotheses: Sequence[parameters.LegHypothesis], recordings: Sequence[Recording]
    ) -> None:
        robots = [h.robot for h in hypotheses]
        belt = np.array([r.of_joints("belt_ratio") for r in robots])
        peak = np.array([[j.motor.peak_torque for j in (r.hip, r.knee)] for r in robots]) * belt
        speed = np.array([r.of_joints("no_load_speed") for r in robots])
        own = np.array([r.of_joints("torque_limit") for r in robots])
        fitted = drive_values(hypotheses, "torque_limit")
        pairs = (recording.metadata.torque_limit for recording in recordings)
        limits = [np.where(np.isnan(fitted), pair or own, fitted) for pair in pairs]
        self._limit = np.stack(limits, axis=1).reshape(-1, 2)
        self._peak = np.repeat(peak, len(recordings), axis=0)
        self._slope = np.repeat(peak / speed, len(recordings), axis=0)

    def at(self, qd: Array) -> tuple[Array, Array]:
        """Return lower and upper bound at joint velocities, N m, (n, 2) each."""
        drop = self._slope * qd
        upper = np.clip(self._peak - drop, 0.0, self._limit)
        lower = np.clip(-self._peak - drop, -self._limit, 0.0)
        return lower, upper


class DelayLine:
    """Values so many ticks, (n,), late; before the first comes the first, or a given ``past``."""

    def __init__(self, delay: Array) -> None:
        self._whole = np.floor(delay).astype(int)
        self._part = (delay - self._whole)[:, None]
        depth = int(self._whole.max(initial=0)) + 2
        self.back = np.arange(1, depth + 1)[:, None, None]
        self.past: Array | None = None
        self._rows, self._slot = np.arange(len(delay)), 0

    def push(self, value: Array) -> tuple[Array, Array]:
        """Take the values of this tick, (n, 2); return what arrives: two shares, to be added."""
        depth = len(self.back)
        if self.past is None:
            self.past = np.repeat(value[None], depth, axis=0)
        self._slot = (self._slot - 1) % depth
        self.past[self._slot] = value
        near, far = (self._slot + self._whole) % depth, (self._slot + self._whole + 1) % depth
        part = self._part
        return (1 - part) * self.past[near, self._rows], part * self.past[far, self._rows]


class VelocityWindow:
    """Mean velocities over the last stretch of time, s, (n,), from positions at ticks, s.

    A stretch of zero passes the velocity of the moment. That of the first tick, rad/s, (n, 2), is
    taken for the one before it.
    """

    def __init__(self, window: Array, tick: float, position: Array, velocity: Array) -> None:
        ticks = np.maximum(window / tick, 1e-9)
        self._window, self._instant = (ticks * tick)[:, None], (window <= 0)[:, None]
        self._line = DelayLine(ticks)
        self._line.past = position - tick * self._line.back * velocity

    def push(self, position: Array, velocity: Array) -> Array:
        """Return the velocity that the drive sees at this tick, rad/s, (n, 2)."""
        near, far = self._line.push(position)
        return np.where(self._instant, velocity, (position - near - far) / self._window)
