"""Simulations take on models of their own, and give them up again."""

import numpy as np
from mujoco import batch

from hopping_leg.robot import build_model, load_robot
from hopping_leg.sim.mismatch_model import set_model_fields
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, WIDE_RANGES, sample

LEG = load_robot("legv2-paper")
OTHERS = sample(LEG, (*IDENTIFIABLE_RANGES, *WIDE_RANGES), 3, np.random.default_rng(0))


def models(robots):
    return [build_model(robot, 1e-3) for robot in robots]


def fall(simulation, count=400):
    """Return the state of every simulation after it fell to the ground from its start."""
    simulation.reset(stage=0)
    simulation.bind("qpos")[:] = [0.4, 0.7, -1.4]
    simulation.step(nstep=count)
    return simulation.bind("qpos").copy()


def test_each_simulation_goes_by_its_own_model():
    own = models(OTHERS)
    simulation = batch.Batch(own[0], 3, 1)
    set_model_fields(simulation, own)
    given = batch.Batch(own[0], 3, 1)
    given.set_models(own)
    np.testing.assert_array_equal(fall(simulation), fall(given))
    assert np.ptp(fall(simulation), axis=0).min() > 1e-6


def test_what_was_taken_on_can_be_given_up():
    simulation = batch.Batch(models([LEG])[0], 3, 1)
    before = fall(simulation)
    set_model_fields(simulation, models(OTHERS))
    assert not np.array_equal(fall(simulation), before)
    set_model_fields(simulation, models([LEG] * 3))
    np.testing.assert_array_equal(fall(simulation), before)


def test_robots_that_differ_do_so_in_floating_point_alone():
    one, *rest = models([LEG, *OTHERS])
    for name in batch.MODEL_FIELDS:
        value = getattr(one, name, None)
        if isinstance(value, np.ndarray) and value.dtype.kind != "f":
            assert all(np.array_equal(getattr(model, name), value) for model in rest), name
