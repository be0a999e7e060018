"""The leg simulated: many legs at once at the control rate, with noise and delay."""

from hopping_leg.sim.channel import NO_NOISE, SAMPLES, Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.leg_simulator import LegSimulator, compile_physics
from hopping_leg.sim.plant import Plant, SoftLimiter
from hopping_leg.sim.simulator import CONTROL_RATE, Simulator
from hopping_leg.sim.stepper import LOADS

__all__ = [
    "CONTROL_RATE",
    "LOADS",
    "NO_NOISE",
    "SAMPLES",
    "Channel",
    "LegSimulator",
    "Measurement",
    "NoiseAndDelay",
    "Plant",
    "Simulator",
    "SoftLimiter",
    "compile_physics",
]
