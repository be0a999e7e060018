"""A policy without dates: it is told that every sample came on time, as the paper's inputs do.

``hop evaluate examples/undated.py:Fast fast`` shows what the ages are worth.
"""

import dataclasses

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.protocol import SAMPLES, Measurement
from hopping_leg.controllers.registry import load_controller
from hopping_leg.robot import Robot, load_robot


class Fast:
    """The policy ``fast``; subclasses name others."""

    of = "fast"

    def __init__(self, robot: Robot, rate: float) -> None:
        self.policy = load_controller(self.of, robot, rate=rate)
        self.age, self.reset = np.arange(SAMPLES) / rate, self.policy.reset

    def act(self, measurement: Measurement) -> Array:
        """Return the policy's torques, with false ages."""
        age = np.broadcast_to(self.age, measurement.age.shape)
        return self.policy.act(dataclasses.replace(measurement, age=age))


class Rl(Fast):
    """The policy ``rl``."""

    of = "rl"


class Universal(Fast):
    """The policy ``universal``."""

    of = "universal"


if __name__ == "__main__":
    leg = load_robot("legv2-identified")
    for name in ("Fast", "Rl", "Universal"):
        controller = load_controller(f"{__file__}:{name}", leg)
        run = rollout(controller, RolloutConfig(leg), np.full((1000, 8), 0.3), seed=0)
        print(f"{name} without dates: up to {run.data['height_m'][200:].max():.3f} m, not 0.3 m")
