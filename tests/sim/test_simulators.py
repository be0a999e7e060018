"""The mechanics that the stepper and MuJoCo, its reference, obey."""

import mujoco
import numpy as np
import pytest
from mujoco import batch

from hopping_leg.robot import GRAVITY, TIMESTEP, get_spec, load_robot
from hopping_leg.sim import LegSimulator, stepper
from hopping_leg.sim.leg_table import leg_table
from tests.sim.legs import POSTURE, with_joints

PAPER, CAD = load_robot("legv2-paper"), load_robot("legv2")


class MujocoLegs(LegSimulator):
    """Legs in MuJoCo instead, without a reality: motors obey their limits at every physics step."""

    def __init__(self, robot, count, threads=1):
        super().__init__(robot, count, threads=threads)
        spec = get_spec(robot)
        spec.option.tolerance, spec.option.iterations = 1e-15, 200  # on to rounding
        for actuator in spec.actuators:
            actuator.ctrllimited = False
        # An unstable leg must be seen, not put back to where it began.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        model = spec.compile()
        self.batch = batch.Batch(model, count, threads)
        self._friction = self.batch.expand("dof_frictionloss")[:, 1:]
        self._one_table = leg_table([robot] * count, TIMESTEP)
        first = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        self.state = self.batch.state[:, first : first + 6]
        self.height, self.height_rate = self.state[:, 0], self.state[:, 3]
        self.q, self.qd = self.state[:, 1:3], self.state[:, 4:6]

    def step(self, torque):
        ctrl, force = self.batch.bind("ctrl"), self.batch.bind("qfrc_applied")
        total, given = np.zeros((self.count, 2)), self.records["motor_torque"]
        force[:, 0] = self._push
        for _ in range(self.substeps):
            stepper.motor_torques(self._one_table, torque, self.qd, given, self._friction)
            ctrl[:] = given / self.robot.of_joints("belt_ratio")
            self.batch.step(nstep=1)
            total += given
        return total / self.substeps


ENGINES = {"stepper": LegSimulator, "mujoco": MujocoLegs}


@pytest.mark.parametrize("engine", ENGINES)
def test_drop_on_the_rail_follows_friction_and_damping(engine):
    """A straight leg falls as a point mass: m v' = -m g + Fc - b v, the closed form beside it."""
    legs = ENGINES[engine](PAPER, 1, threads=1)
    legs.place(slice(None), 3.0, np.zeros(2))
    damping, force = PAPER.rail.damping, PAPER.mass * GRAVITY - PAPER.rail.friction
    for _ in range(60):
        legs.step(np.zeros((1, 2)))
    speed = force / damping * (1 - np.exp(-damping * 0.3 / PAPER.mass))
    np.testing.assert_allclose(legs.height_rate, -speed, rtol=2e-3)
    np.testing.assert_allclose(legs.q, 0.0, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_became_unstable_stays_so_and_its_neighbour_goes_on(engine):
    alone, legs = (ENGINES[engine](PAPER, count, threads=1) for count in (1, 2))
    alone.stand(slice(None), POSTURE)
    legs.stand(slice(None), POSTURE)
    legs.qd[0] = 1e12
    for _ in range(20):
        alone.step(np.zeros((1, 2)))
        legs.step(np.zeros((2, 2)))
    assert not np.isfinite(legs.state[0]).all()
    np.testing.assert_array_equal(legs.q[1], alone.q[0])


def test_motor_line_gain_load_friction_and_pushes_are_the_steppers():
    robot = with_joints(CAD, torque_gain=0.8, load_friction=0.2)
    reference, legs = MujocoLegs(robot, 4), LegSimulator(robot, 4, threads=1)
    rng = np.random.default_rng(0)
    push = rng.normal(0, 5, 4)
    for one in (reference, legs):
        one.stand(slice(None), POSTURE, 0.02)
        one.push(push)
    limited = 0
    for _ in range(30):
        torque = rng.uniform(-14, 14, (4, 2))
        given = reference.step(torque)
        np.testing.assert_allclose(legs.step(torque), given, atol=1e-9)
        np.testing.assert_allclose(legs.measured_torque, reference.measured_torque, atol=1e-9)
        np.testing.assert_allclose(legs.state, reference.state, atol=1e-9)
        legs.state[:] = reference.state
        limited += np.count_nonzero(np.abs(given - 0.8 * torque) > 1e-6)
    assert limited > 10
