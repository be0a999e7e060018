"""What the leg is: parameters, geometry, kinematics and dynamics."""

from hopping_leg.robot.hardware import REGISTER_MAP, Hardware
from hopping_leg.robot.limits import (
    OVERSPEED,
    MotorLimit,
    SoftLimits,
    braking_times,
    command_limits,
)
from hopping_leg.robot.model import (
    COARSE_TIMESTEP,
    CONTROL_RATE,
    GRAVITY,
    TIMESTEP,
    build_model,
    compile_spec,
    get_spec,
    to_urdf,
)
from hopping_leg.robot.model_mismatch import (
    NO_MISMATCH,
    STANDING_NOISE,
    DriveMismatch,
    GroundMismatch,
    Latency,
)
from hopping_leg.robot.parameters import JOINTS, Boom, Joint, Link, Robot
from hopping_leg.robot.robot_checks import check_physics, numbers
from hopping_leg.robot.robot_files import (
    DEFAULT_ROBOT,
    doubts,
    load_robot,
    load_tree,
    parent_robot,
    robot_from_tree,
    robot_text,
    robot_tree,
    shipped_robots,
)

__all__ = [
    "COARSE_TIMESTEP",
    "CONTROL_RATE",
    "DEFAULT_ROBOT",
    "GRAVITY",
    "JOINTS",
    "NO_MISMATCH",
    "OVERSPEED",
    "REGISTER_MAP",
    "STANDING_NOISE",
    "TIMESTEP",
    "Boom",
    "DriveMismatch",
    "GroundMismatch",
    "Hardware",
    "Joint",
    "Latency",
    "Link",
    "MotorLimit",
    "Robot",
    "SoftLimits",
    "braking_times",
    "build_model",
    "check_physics",
    "command_limits",
    "compile_spec",
    "doubts",
    "get_spec",
    "load_robot",
    "load_tree",
    "numbers",
    "parent_robot",
    "robot_from_tree",
    "robot_text",
    "robot_tree",
    "shipped_robots",
    "to_urdf",
]
