"""The leg simulated: many legs at once at the control rate, with noise and delay."""

from hopping_leg.sim.any_legs import AnyLegs, Engine, Ground
from hopping_leg.sim.disturbance import NOTHING, SAMPLES, Channel, Disturbance, Measurement
from hopping_leg.sim.engines import check_ground, make_legs
from hopping_leg.sim.legs import CONTROL_RATE, Legs
from hopping_leg.sim.plant import Plant

__all__ = [
    "CONTROL_RATE",
    "NOTHING",
    "SAMPLES",
    "AnyLegs",
    "Channel",
    "Disturbance",
    "Engine",
    "Ground",
    "Legs",
    "Measurement",
    "Plant",
    "check_ground",
    "make_legs",
]
