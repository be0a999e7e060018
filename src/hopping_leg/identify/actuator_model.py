"""The leg on its rig as a MuJoCo model, and the actuators of many simulations, a row each."""

from collections.abc import Sequence

import mujoco
import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.errors import RobotError
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from hopping_leg.identify.recording_format import Rig
from hopping_leg.robot.model import GRAVITY, get_spec
from hopping_leg.robot.parameters import Robot

FIELDS = (
    "actuator_biasprm",
    "actuator_forcerange",
    "body_inertia",
    "body_invweight0",
    "body_ipos",
    "body_mass",
    "body_pos",
    "body_subtreemass",
    "dof_M0",
    "dof_armature",
    "dof_damping",
    "dof_frictionloss",
    "dof_invweight0",
    "geom_friction",
    "geom_pos",
    "geom_rbound",
    "geom_size",
    "geom_solref",
    "opt.gravity",
)
"""Fields of a model in which hypotheses may differ."""


def build_rig_model(
    robot: Robot, rig: Rig, timestep: float, gravity: float = GRAVITY
) -> mujoco.MjModel:
    """Compile a robot on its rig.

    An actuator's force is ``ctrl - kp q - kd qd`` at the joint, bounded by its force range; the
    gains stand in ``biasprm`` and are zero here. So a drive's own loop acts at every physics step
    if ``ctrl = kp q* + kd qd* + feed-forward``.

    Args:
        robot: Parameters of the leg.
        rig: A fixed base has no rail joint and touches nothing.
        timestep: Physics step, s.
        gravity: Acceleration of the base in free flight, m/s2.

    Raises:
        RobotError: MuJoCo refuses the parameters.
    """
    spec = get_spec(robot, timestep)
    spec.option.gravity = [0, 0, -gravity]
    # A simulation that breaks down must not go on from a default state unnoticed.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # One leg is one island; to look for others takes a tenth of a step.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    fixed = rig == "fixed-base"
    if fixed:
        spec.delete(spec.joint("rail"))
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
        model = spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise RobotError(f"MuJoCo cannot build robot '{robot.name}': {reason}.") from error
    return model


def model_field(model: mujoco.MjModel, name: str) -> np.ndarray:
    """Return a model's field by the name that ``Batch.expand`` knows it by."""
    owner = model.opt if name.startswith("opt.") else model
    value: np.ndarray = getattr(owner, name.removeprefix("opt."))
    return value


def drive_values(hypotheses: Sequence[LegHypothesis], name: str) -> Array:
    """Return an attribute of both drives, (hypotheses, 2)."""
    return np.array([[getattr(h.drive.hip, name), getattr(h.drive.knee, name)] for h in hypotheses])


def recorded_gains(recording: Recording, name: str) -> Array:
    """Return what a recording says about a gain of its on-board PD, (rows, 2), NaN if unknown.

    Args:
        recording: Rows win over the metadata.
        name: ``stiffness``, ``damping`` or ``integral``.
    """
    pair = getattr(recording.metadata, name)
    values: Array = np.tile((np.nan, np.nan) if pair is None else pair, (len(recording), 1))
    if name == "integral":
        return np.nan_to_num(values)
    rows: Array = recording.array(name)
    return np.where(np.isnan(rows), values, rows)


class MotorBounds:
    """Smallest and largest torque of each joint at its speed, as ``robot.limits.MotorLimit``.

    Args:
        hypotheses: Legs with the motors and their limits.
        recordings: One per window; a limit in the metadata replaces the robot's software limit.
    """

    def __init__(
        self, hypotheses: Sequence[LegHypothesis], recordings: Sequence[Recording]
    ) -> None:
        robots = [h.robot for h in hypotheses]
        belt = np.array([r.of_joints("belt_ratio") for r in robots])
        peak = np.array([[j.motor.peak_torque for j in (r.hip, r.knee)] for r in robots]) * belt
        speed = np.array([r.of_joints("no_load_speed") for r in robots])
        own = np.array([r.of_joints("torque_limit") for r in robots])
        fitted = drive_values(hypotheses, "torque_limit")
        limits = []
        for recording in recordings:
            pair = recording.metadata.torque_limit
            known = own if pair is None else np.broadcast_to(np.array(pair), own.shape)
            limits.append(np.where(np.isnan(fitted), known, fitted))
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
    """Torques that arrive a fraction of ticks late; before the first comes the first.

    Args:
        delay: In ticks, (n,).
    """

    def __init__(self, delay: Array) -> None:
        self._whole = np.floor(delay).astype(int)
        self._part = (delay - self._whole)[:, None]
        self._depth = int(self._whole.max(initial=0)) + 2
        self._past: list[Array] = []
        self._rows = np.arange(len(delay))

    def push(self, torque: Array) -> Array:
        """Return what arrives in the tick in which ``torque`` was computed, (n, 2)."""
        self._past = [torque, *self._past][: self._depth]
        stack = np.stack(self._past)
        newest = np.minimum(self._whole, len(stack) - 1)
        older = np.minimum(self._whole + 1, len(stack) - 1)
        part = self._part
        due: Array = (1 - part) * stack[newest, self._rows] + part * stack[older, self._rows]
        return due


class VelocityWindow:
    """Mean velocities over the last stretch of time, from positions at ticks.

    Args:
        window: s, (n,); zero passes the velocity of the moment.
        tick: From one position to the next, s.
        position: At the first tick, rad, (n, 2).
        velocity: At the first tick and, so assumed, before, rad/s, (n, 2).
    """

    def __init__(self, window: Array, tick: float, position: Array, velocity: Array) -> None:
        self._ticks = np.maximum(window / tick, 1e-9)
        self._instant = (window <= 0)[:, None]
        self._whole = np.floor(self._ticks).astype(int)
        self._part = (self._ticks - self._whole)[:, None]
        depth = int(self._whole.max(initial=0)) + 2
        back = np.arange(1, depth + 1)[:, None, None]
        self._ring = position - tick * back * velocity
        self._window = (self._ticks * tick)[:, None]
        self._rows, self._newest = np.arange(len(window)), depth - 1

    def push(self, position: Array, velocity: Array) -> Array:
        """Return the velocity that the drive sees at this tick, rad/s, (n, 2)."""
        depth = len(self._ring)
        self._newest = (self._newest + 1) % depth
        slot = (depth - 1 - self._newest) % depth
        self._ring[slot] = position
        near = self._ring[(slot + self._whole) % depth, self._rows]
        far = self._ring[(slot + self._whole + 1) % depth, self._rows]
        mean = (position - (1 - self._part) * near - self._part * far) / self._window
        return np.where(self._instant, velocity, mean)
