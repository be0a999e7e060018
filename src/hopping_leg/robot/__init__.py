"""What the leg is: parameters, geometry, kinematics and dynamics."""

from hopping_leg.robot.model import build_model, get_spec
from hopping_leg.robot.parameters import Robot
from hopping_leg.robot.robot_files import load_robot, shipped_robots

__all__ = ["Robot", "build_model", "get_spec", "load_robot", "shipped_robots"]
