"""Energy shaping, the paper's baseline: the controllers that are shipped and compared."""

from hopping_leg.controllers.energy_shaping.controller import EnergyShaping, LiteralEnergyShaping
from hopping_leg.controllers.energy_shaping.gains import (
    TUNED,
    ShapingGains,
    load_gains,
    scale_gains,
)
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import CONTROL_RATE


def tuned_energy_shaping(
    robot: Robot, *, rate: float = CONTROL_RATE, gains: str = TUNED
) -> EnergyShaping:
    """Return the baseline with shipped gains or those of a file, carried over to ``robot``.

    Shipped ones are those that were tuned on this very leg, if there are any.
    """
    found = load_gains(gains, robot)
    scaled = scale_gains(found.gains, load_robot(found.robot), robot)
    return EnergyShaping(robot, scaled, rate=rate, name=gains)


def paper_energy_shaping(robot: Robot, *, rate: float = CONTROL_RATE) -> LiteralEnergyShaping:
    """Return the paper's law and gains with nothing added."""
    gains = scale_gains(ShapingGains(), load_robot(load_gains().robot), robot)
    return LiteralEnergyShaping(robot, gains, rate=rate, name="energy-shaping-literal")
