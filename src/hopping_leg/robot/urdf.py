"""URDF of a leg, for users of other tools.

URDF knows neither a motor's reflected inertia, which stands in a comment at each joint, nor its
torque-speed limit: a joint's ``velocity`` is the speed at which its motor has no torque left. Its
``limit`` are the mechanical stops. All is at the joint's side of the belt. Inertia around the axes
a planar link cannot turn about only has to be valid.
"""

from importlib import resources
from xml.sax.saxutils import quoteattr

from hopping_leg.robot.parameters import Robot


def to_urdf(robot: Robot) -> str:
    """Return the leg as URDF: rail (passive), hip, knee, and a fixed frame ``foot``.

    The world's z is up, positive angles swing the foot to +x, zero is the straight leg downwards.
    """
    text = (resources.files("hopping_leg.robot") / "leg.urdf").read_text(encoding="utf-8")
    half = {f"half_{name}": getattr(robot, name).length / 2 for name in ("thigh", "shank")}
    return text.format(robot=robot, name=quoteattr(robot.name), **half)
