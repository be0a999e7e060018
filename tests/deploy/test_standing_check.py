import numpy as np
import pytest

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.deploy.motion_sequence import MotionSequence, Part, SequenceTiming, hopping_poses
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.standing_check import upward_force
from hopping_leg.io import replace_at
from hopping_leg.robot import dynamics, kinematics, load_robot
from hopping_leg.sim import LegSimulator
from tests.controllers.measurements import steady
from tests.deploy.fakes import Still

TIMING = SequenceTiming(rise=1.5)
COUNT = 12


@pytest.mark.parametrize("robot", ["legv2", "legv2-identified", "legv1"])
@pytest.mark.parametrize("push", [(0.0, 1.0), (0.3, 0.8), (-0.5, 1.7)])
def test_a_known_force_at_the_foot_is_found(robot, push):
    """Statics by virtual work: the foot's displacement is taken from differences."""
    leg, q = load_robot(robot), np.array([0.7, -1.5])
    weight, *joints = dynamics.gravity_force(leg, q)

    def foot(angles):
        ends = np.cumsum(angles)
        lengths = np.array([leg.thigh.length, leg.shank.length])
        return np.array([lengths @ np.sin(ends), -lengths @ np.cos(ends)])

    steps = 1e-6 * np.eye(2)
    jacobian = np.stack([(foot(q + s) - foot(q - s)) / 2e-6 for s in steps], axis=1)
    torque = np.array(joints) - jacobian.T @ (weight * np.array(push))
    assert upward_force(leg, q, torque) == pytest.approx(push[1], abs=1e-6)


def starts(robot, wiring, rng):
    """Draw poses with a foot below the hip, and those that such drives believe, all allowed."""
    length = robot.thigh.length + robot.shank.length
    allowed = np.transpose(hopping_limits(robot, 200.0).start)
    stops = np.transpose([[j.stop_lower, j.stop_upper] for j in (robot.hip, robot.knee)])
    found = []
    while len(found) < COUNT:
        foot = length * np.array([rng.uniform(0.4, 0.98), rng.uniform(-0.15, 0.15)])
        side = rng.choice([-1, 1])  # to which the knee bends
        true = side * kinematics.joint_angles(robot, foot * [1, side])
        homes = np.stack([np.zeros(2), hopping_poses(robot).start, true])
        home = rng.choice(homes)
        believed = home + wiring @ (true - home)
        limits, pose = np.stack([allowed, stops]), np.stack([believed, true])
        if (limits[:, 0] <= pose).all() and (pose <= limits[:, 1]).all():
            found.append((true, believed))
    return np.swapaxes(found, 0, 1)


def share_that_may_hop(robot, wiring, *, truth=None, seed=0):
    """Let legs rise and squat whose drives believe another motion of the joints than the true."""
    true, believed = starts(robot, wiring, np.random.default_rng(seed))
    offset = believed - true @ wiring.T
    legs = LegSimulator(truth or robot, COUNT, rate=200, threads=1)
    legs.stand(slice(None), true)
    schedule, poses = CommandSchedule(((0.3, 100.0),)), hopping_poses(robot)
    sequences = [
        MotionSequence(Still(), schedule, poses, None, TIMING, checked=robot) for _ in range(COUNT)
    ]
    for sequence, q in zip(sequences, believed, strict=True):
        sequence.begin(0.0, q)
    limits, stopped, squatted = hopping_limits(robot, 200.0), *np.zeros((2, COUNT), bool)
    most = np.array(limits.torque)
    for tick in range(round(200 * (TIMING.rise + TIMING.squat)) + 2):
        q, qd = legs.measured_q @ wiring.T + offset, legs.measured_qd @ wiring.T
        ahead = q + np.array(limits.braking) * qd
        stopped |= ((np.minimum(q, ahead) < limits.lower) | (ahead > limits.upper)).any(axis=1)
        torque = np.zeros((COUNT, 2))
        for i in np.flatnonzero(~stopped):
            step = sequences[i].step(tick / 200, steady(q[i], qd[i]))
            stopped[i] = bool(step.trouble)
            torque[i] = np.clip(step.torque, -most, most)
            squatted[i] = step.phase is Part.SETTLE
        legs.step(torque @ wiring)
    assert (squatted | stopped).all()
    return 1 - stopped.mean()


BELT = 2.0
WRONG = {
    "hip reversed": np.diag([-1.0, 1.0]), "knee reversed": np.diag([1.0, -1.0]),
    "swapped": np.array([[0, BELT], [1 / BELT, 0]]),
    "swapped, one reversed": np.array([[0, BELT], [-1 / BELT, 0]]),
    "swapped, the other reversed": np.array([[0, -BELT], [1 / BELT, 0]]),
    "belt of half the ratio": np.diag([1.0, 0.5]),
    "belt of two thirds of the ratio": np.diag([1.0, 2 / 3]),
    "belt of one and a half times the ratio": np.diag([1.0, 1.5]),
    "belt of twice the ratio": np.diag([1.0, 2.0]),
}  # fmt: skip
"""What drives believe of the joints' motion, times what is true, (2, 2)."""


@pytest.mark.parametrize("wrong", WRONG)
def test_a_leg_that_is_wired_wrongly_never_hops_wherever_it_was_homed(wrong):
    assert share_that_may_hop(load_robot("legv2-identified"), WRONG[wrong]) == 0


@pytest.mark.parametrize(
    ("robot", "truth"),
    [
        ("legv2", "legv2"),
        ("legv2-identified", "legv2-identified"),
        ("legv2-paper", "legv2-paper"),
        ("legv1", "legv1"),
        ("legv2", "legv2-identified"),
        ("legv2", "legv2-paper"),
    ],
)
def test_a_leg_of_its_file_may_hop_and_so_may_one_whose_friction_no_file_tells(robot, truth):
    may = share_that_may_hop(load_robot(robot), np.eye(2), truth=load_robot(truth))
    assert may >= 0.9


def test_a_leg_much_heavier_or_lighter_than_its_file_does_not_hop():
    robot = load_robot("legv2")
    for share in (0.6, 1.5):
        other = replace_at(robot, "base.mass", (share - 1) * robot.mass + robot.base.mass)
        assert share_that_may_hop(robot, np.eye(2), truth=other) == 0
