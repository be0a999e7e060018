import dataclasses

import mujoco
import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import TraceError, UsageError
from hopping_leg.identify.excitation import (
    Multisine,
    inverse_dynamics,
    load_excitation,
    make_excitation,
)
from hopping_leg.identify.paper_excitation import Stroke, Strokes, adapt, fixed_base, moving_base
from hopping_leg.robot import build_model, kinematics, load_robot
from hopping_leg.trace import Trace
from tests.identify.runs import RECORDINGS, needs_recordings, swinging
from tests.sim.legs import with_joints

ROBOT = load_robot("legv2")
REACH = ROBOT.thigh.length + ROBOT.shank.length
LAB = fixed_base((0.1, 0.075, 0.05), (1.0, 0.5, 0.25), (5.0, 10.0), margin=0.005)


def stopped(**stops):
    """Return the leg with other mechanical stops."""
    joints = {
        name: dataclasses.replace(getattr(ROBOT, name), stop_lower=low, stop_upper=high)
        for name, (low, high) in stops.items()
    }
    return dataclasses.replace(ROBOT, **joints)


@pytest.mark.parametrize("bend", ["backward", "forward"])
@pytest.mark.parametrize("swing", [10.0, None], ids=["swinging", "vertical"])
def test_the_foot_follows_the_papers_formula(bend, swing):
    time = np.arange(0, 10, 0.005)
    angles = Stroke(0.1, 0.5, swing, 10.0, margin=0.005, bend=bend).joints(ROBOT, time)
    distance = 0.1 * np.cos(2 * np.pi * time / 0.5) + REACH - 0.1 - 0.005
    theta = -np.pi / 2 * np.cos(2 * np.pi * time / 10) if swing else 0.0
    foot = kinematics.foot_position(ROBOT, angles)
    np.testing.assert_allclose(foot[:, 0], distance * np.cos(theta), atol=1e-9)
    np.testing.assert_allclose(foot[:, 1], distance * np.sin(theta), atol=1e-9)
    assert (np.sign(angles[:, 1]) == (-1 if bend == "backward" else 1)).all()


@pytest.mark.parametrize("robot", ["legv2", "legv2-paper", "legv1", "doublependulum"])
@pytest.mark.parametrize("template", [fixed_base(), moving_base()], ids=["fixed", "moving"])
def test_the_adapted_grid_can_be_played(robot, template):
    leg = load_robot(robot)
    adapted = adapt(template, leg)
    excitation = make_excitation(adapted, leg)
    assert len(excitation) == 48000, "four minutes at 200 Hz"
    assert {p.amplitude for p in template.parts} == {0.15, 0.1, 0.05}
    assert {p.period for p in template.parts} == {0.75, 0.5, 0.25}
    pairs = zip(adapted.parts, template.parts, strict=True)
    assert all(a.amplitude <= p.amplitude for a, p in pairs)
    assert adapt(adapted, leg) == adapted


@pytest.mark.parametrize(
    ("template", "stops", "reason"),
    [
        (fixed_base(), {}, r"at 0\.\d+ s, hip: the foot is out of reach"),
        (LAB, {"knee": (-2, 0)}, r"knee: -2\.\d+ rad is outside of the stops -2 and 0 rad"),
        (LAB, {"hip": (0.0, 2.0)}, r"at 0\.000 s, hip: .* outside"),
        (fixed_base((0.1,), (0.2,), (10.0,), margin=0.005), {}, r"knee: .* rad/s exceeds 22"),
        (fixed_base((0.05,), (0.2,), (10.0,), margin=0.005), {}, "knee: .* N m at .* exceeds"),
        (moving_base((0.11,), (1.0,), margin=0.005), {}, "knee is .* mm above the ground"),
        (Multisine((0.7, -1.4), (0.3, 2.0)), {}, "knee: .* outside"),
    ],
)
def test_what_the_leg_cannot_do_is_refused_with_joint_and_time(template, stops, reason):
    with pytest.raises(UsageError, match=reason) as caught:
        make_excitation(template, stopped(**stops))
    assert " s, " in str(caught.value)


def test_a_multisine_starts_and_ends_at_rest_in_its_posture():
    template = Multisine((0.7, -1.4), (0.3, 0.4))
    excitation = make_excitation(template, ROBOT, track_velocity=True)
    excursion = excitation.position - [0.7, -1.4]
    np.testing.assert_allclose(excursion[[0, -1]], 0, atol=1e-6)
    assert (np.abs(excursion).max(axis=0) <= np.array([0.3, 0.4]) * 1.005).all()
    assert (np.abs(excursion).max(axis=0) >= np.array([0.3, 0.4]) * 0.9).all()
    np.testing.assert_allclose(
        excitation.velocity, np.gradient(excitation.position, 0.005, axis=0), atol=1e-9
    )


def test_the_file_keeps_every_target_and_another_file_is_none(tmp_path):
    first = make_excitation(LAB, ROBOT)
    first.save(tmp_path / "excitation.parquet")
    back = load_excitation(tmp_path / "excitation.parquet")
    np.testing.assert_array_equal(back.position, first.position)
    assert (back.velocity == 0).all()
    assert (back.rig, back.rate, back.robot) == ("fixed-base", 200.0, "legv2")
    assert back.description == first.description
    Trace(swinging()).save(tmp_path / "trace.parquet")
    with pytest.raises(TraceError, match="is no excitation"):
        load_excitation(tmp_path / "trace.parquet")


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: fixed_base((0.1,), (1.0, 2.0)), "1 amplitudes and 2 periods do not pair"),
        (lambda: fixed_base(duration=8.0), "6 strokes lasts 1.33 s, .* make them 120 s"),
        (lambda: adapt(LAB, stopped(hip=(0.0, 0.1))), "hip: .* outside"),
        (lambda: fixed_base((0.0,), (1.0,)), "'amplitude' is 0 but must be positive"),
        (lambda: moving_base(margin=-0.1), "'margin' is -0.1 m but must be zero or more"),
        (lambda: Multisine((0, 0), (1, 1), lowest=2, highest=1), "'highest' is 1 Hz"),
        (lambda: make_excitation(LAB, ROBOT, rate=0.001), "make it longer"),
    ],
)
def test_numbers_without_meaning_are_refused(make, sentence):
    with pytest.raises(UsageError, match=sentence):
        make()


@needs_recordings
@pytest.mark.parametrize(
    ("file", "stroke", "start"),
    [
        ("seg0", (0.1, 1.0, 5.0), 0),
        ("seg2", (0.075, 0.5, 10.0), 16000),
        ("seg4", (0.05, 0.25, 40.0), 32000),
    ],
)
def test_the_template_is_what_the_lab_commanded(file, stroke, start):
    """The recordings hold their targets: L1 = L2 = 0.15 m, 5 mm margin, knee forward."""
    leg = dataclasses.replace(ROBOT, shank=dataclasses.replace(ROBOT.shank, length=0.15))
    table = pl.read_csv(next((RECORDINGS / "legv2_fixed_base").glob(f"*{file}*")))
    time = np.arange(48000) * 240 / 47999
    played = Strokes((Stroke(*stroke, 240.0, 0.005, "forward"),)).joints(leg, time)
    velocity = np.gradient(played, time, axis=0)
    rows = slice(start + 1, start + 7999)
    commanded = table.select("hip_pos_cmd", "knee_pos_cmd").to_numpy()
    np.testing.assert_allclose(played[rows], commanded[1:-1], atol=1e-6)
    commanded = table.select("hip_vel_cmd", "knee_vel_cmd").to_numpy()
    np.testing.assert_allclose(velocity[rows], commanded[1:-1], atol=1e-4)


FRICTIONLESS = with_joints(ROBOT, friction=0.0, damping=0.0)


def mujoco_torque(q, qd, qdd, climb, force):
    """Return generalised forces of a motion less what the ground's force at the foot gives."""
    model = build_model(FRICTIONLESS)
    model.geom_contype[:] = 0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = [1.0, *q], [0.0, *qd], [climb, *qdd]
    mujoco.mj_inverse(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, model.site("foot").id)
    return data.qfrc_inverse - force * jacobian[2]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rig", ["fixed-base", "rail"])
def test_a_motion_needs_mujocos_torques_and_the_ground_never_pulls(rig, seed):
    rng = np.random.default_rng(seed)
    q = np.array([0.7, -1.4]) + rng.normal(size=2) * 0.3
    qd, qdd = rng.normal(size=(2, 2)) * [[3], [20]]
    torque = inverse_dynamics(FRICTIONLESS, rig, q, qd, qdd)
    step, climb, force = 1e-4, 0.0, 0.0
    if rig == "rail":
        height = [
            kinematics.stance_height(FRICTIONLESS, q + qd * s + qdd * s**2 / 2)
            for s in (-step, 0, step)
        ]
        climb = float(np.diff(height, 2)[0] / step**2)
        force = mujoco_torque(q, qd, qdd, climb, 0.0)[0]
        if force < 0:
            free = mujoco_torque(q, qd, qdd, 0.0, 0.0)[0]
            climb, force = -free / FRICTIONLESS.mass, 0.0
        assert mujoco_torque(q, qd, qdd, climb, force)[0] == pytest.approx(0, abs=1e-3)
    expected = mujoco_torque(q, qd, qdd, climb, force)[1:]
    np.testing.assert_allclose(torque, expected, atol=1e-3 if rig == "rail" else 1e-8)


def test_friction_and_damping_oppose_the_motion():
    motion = np.array([0.3, -1.0]), np.array([2.0, -3.0]), np.zeros(2)
    real, ideal = (inverse_dynamics(r, "fixed-base", *motion) for r in (ROBOT, FRICTIONLESS))
    expected = ROBOT.of_joints("friction") * [1, -1] + ROBOT.of_joints("damping") * motion[1]
    np.testing.assert_allclose(real - ideal, expected)
