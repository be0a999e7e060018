"""The leg simulated: many legs at once at the control rate, with noise and delay."""

from hopping_leg.sim.channel import NO_NOISE, SAMPLES, Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.mujoco_simulator import MujocoSimulator, check_ground, make_simulator
from hopping_leg.sim.plant import Plant
from hopping_leg.sim.simulator import CONTROL_RATE, Engine, Ground, Simulator

__all__ = [
    "CONTROL_RATE",
    "NO_NOISE",
    "SAMPLES",
    "Channel",
    "Engine",
    "Ground",
    "Measurement",
    "MujocoSimulator",
    "NoiseAndDelay",
    "Plant",
    "Simulator",
    "check_ground",
    "make_simulator",
]
