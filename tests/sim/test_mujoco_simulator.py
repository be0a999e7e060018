"""MuJoCo as an engine: the stepper's leg in a hop, refusals."""

import numpy as np
import pytest

from hopping_leg.controllers import registry
from hopping_leg.errors import UsageError
from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import NO_NOISE, Plant, make_simulator
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from tests.sim.legs import POSTURE, with_joints

PAPER = load_robot("legv2-paper")


def hops(engine, robot, ticks):
    """Return heights, joint angles and mean torques of energy shaping, (ticks, 2, 5)."""
    legs = make_simulator(robot, 2, engine=engine, threads=1)
    plant = Plant(legs, NO_NOISE, SoftLimits(), np.random.default_rng(0))
    controller = registry.make_controller("energy-shaping", robot)
    controller.reset(2)
    command = np.array([0.28, 0.33])
    legs.stand(slice(None), POSTURE)
    plant.channel.restart(slice(None), legs.measured_q, legs.measured_qd, command)
    rows = []
    for _ in range(ticks):
        given = plant.drive(controller.act(plant.sense(command)))
        rows.append(np.concatenate([legs.height[:, None], legs.q, given], axis=1))
    return np.array(rows)
