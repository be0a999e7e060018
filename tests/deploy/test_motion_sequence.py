import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.motion_sequence import Part, SequenceTiming, hopping_poses
from hopping_leg.robot import kinematics, load_robot, shipped_robots


def test_the_parts_of_a_sequence_follow_each_other():
    timing = SequenceTiming(hop=10, rise=2, settle=0.5, sink=1.5)
    times = [0, 1.9, 2, 2.4, 2.5, 12.4, 12.5, 13.9, 14.0, 99]
    parts = [timing.phase(t)[0] for t in times]
    assert parts == [
        *(Part.RISE, Part.RISE, Part.SETTLE, Part.SETTLE, Part.HOP),
        *(Part.HOP, Part.SINK, Part.SINK, Part.DONE, Part.DONE),
    ]


@given(st.integers(1, 3000), st.floats(0, 1e6))
def test_a_hop_of_some_ticks_lasts_so_many_wherever_time_began(ticks, began):
    timing = SequenceTiming(hop=ticks / 200, rise=0.4, settle=0.1)
    times = began + np.arange(ticks + 200) * 0.005 - began
    parts = [timing.phase(time)[0] for time in times]
    assert parts.count(Part.HOP) == ticks


@pytest.mark.parametrize("name", [n for n in shipped_robots() if load_robot(n).kind == "leg"])
def test_poses_lie_within_the_soft_limits_with_the_foot_below_the_hip(name):
    robot = load_robot(name)
    poses = hopping_poses(robot)
    for pose in (poses.start, poses.rest):
        assert kinematics.foot_position(robot, pose)[1] == pytest.approx(0, abs=1e-9)
        assert (pose >= robot.of_joints("lower")).all()
        assert (pose <= robot.of_joints("upper")).all()
