"""The energy shaping controllers that are shipped and compared."""

from hopping_leg.control.energy_shaping import EnergyShaping
from hopping_leg.control.gain_files import load_gains
from hopping_leg.control.shaping_gains import (
    LITERAL,
    ROBUST,
    TRUE_CONTACT,
    ShapingGains,
    scale_gains,
)
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim import CONTROL_RATE


def tuned_energy_shaping(robot: Robot, *, rate: float = CONTROL_RATE) -> EnergyShaping:
    """Return the shipped baseline, its gains carried over to ``robot``."""
    found = load_gains()
    gains = scale_gains(found.gains, load_robot(found.robot), robot)
    return EnergyShaping(robot, gains, ROBUST, rate=rate)


def paper_energy_shaping(
    robot: Robot, *, rate: float = CONTROL_RATE, true_contact: bool = False
) -> EnergyShaping:
    """Return the paper's law and gains with nothing added.

    Args:
        robot: The leg.
        rate: Control rate, Hz.
        true_contact: Take contact, base velocity and height from the simulator, so that the law
            is judged apart from what feeds it.
    """
    origin = load_robot(load_gains().robot)
    gains = scale_gains(ShapingGains(), origin, robot)
    options = TRUE_CONTACT if true_contact else LITERAL
    return EnergyShaping(robot, gains, options, rate=rate, name="energy-shaping-literal")
