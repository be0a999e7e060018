"""The leg on its rig as a MuJoCo model, with a drive that is a spring and damper at each joint."""

import mujoco
import numpy as np

from hopping_leg.errors import RobotError
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
        gravity: Of the base in free flight, m/s2.

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
