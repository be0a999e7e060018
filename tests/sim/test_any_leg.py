"""Legs of any size: files that tell all, and legs of a training of which not all is told."""

import numpy as np

from hopping_leg.robot import NO_MISMATCH, check_physics, doubts, load_robot
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.any_leg import SIZES, draw_any_leg, draw_leg

LEG = load_robot("legv2")
DRAWN = [draw_any_leg(seed) for seed in range(120)]


def test_a_drawn_leg_is_a_robot_file_without_doubts(tmp_path):
    for seed in (*range(12), 124):  # the last's motors are too strong for its drives as first drawn
        drawn = draw_leg(seed)
        file = tmp_path / f"{drawn.robot.name}.toml"
        drawn.save(file)
        assert load_robot(file) == drawn.robot == draw_leg(seed).robot
        assert doubts(file) == []
        assert drawn.robot.reality == NO_MISMATCH
        for spread in SIZES:
            part, name = spread.path.split(".")
            factor = getattr(getattr(drawn.robot, part), name) / getattr(getattr(LEG, part), name)
            assert 0.999 * spread.low <= factor <= 1.001 * spread.high


def test_legs_of_a_training_can_be_and_follow_from_their_seeds():
    for seed, leg in enumerate(DRAWN):
        check_physics(leg.true, str(seed))
        assert leg == draw_any_leg(seed)
        reality = leg.true.reality
        for drive in (reality.hip, reality.knee):
            assert drive.stiffness is not None or drive.backlash == 0
    robots = [leg.true for leg in DRAWN]
    legs = LegSimulator(LEG, len(robots), timestep=5e-4, robots=robots)
    legs.place(slice(None), 0.5, np.array([0.6, -1.2]))
    for _ in range(60):
        legs.step(np.zeros((len(robots), 2)))
    assert np.isfinite(legs.state).all()
    assert np.abs(legs.qd).max() < 100


def test_what_is_told_leaves_out_gains_delay_and_transmission():
    told = [leg.believed for leg in DRAWN]
    assert all(robot.reality == NO_MISMATCH for robot in told)
    assert {robot.hip.torque_gain for robot in told} == {1.0}
    assert all(leg.believed.thigh.length == leg.true.thigh.length for leg in DRAWN)
    gains = [leg.true.hip.torque_gain for leg in DRAWN]
    assert 0.42 <= min(gains) < 0.6
    assert max(gains) > 1.2
    heavier = np.array([leg.true.base.mass / leg.believed.base.mass for leg in DRAWN])
    assert heavier.min() < 0.8
    assert heavier.max() > 1.4
    share = np.mean([leg.believed.shank.inertia == leg.true.shank.inertia for leg in DRAWN])
    assert share < 0.3, "hardly any file is right about everything"
