"""The leg simulated: many legs at once at the control rate, with noise and delay."""

from hopping_leg.robot import CONTROL_RATE as CONTROL_RATE
from hopping_leg.sim.channel import NO_NOISE as NO_NOISE
from hopping_leg.sim.channel import SAMPLES as SAMPLES
from hopping_leg.sim.channel import Channel as Channel
from hopping_leg.sim.channel import Measurement as Measurement
from hopping_leg.sim.channel import NoiseAndDelay as NoiseAndDelay
from hopping_leg.sim.leg_simulator import LegSimulator as LegSimulator
from hopping_leg.sim.leg_simulator import compile_physics as compile_physics
from hopping_leg.sim.plant import Plant as Plant
from hopping_leg.sim.plant import SoftLimiter as SoftLimiter
from hopping_leg.sim.stepper import LOADS as LOADS
