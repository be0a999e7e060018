from dataclasses import replace

import numpy as np
import pytest
from tests.identify.runs import RECORDINGS, needs_recordings

from hopping_leg.identify.importers import log_format
from hopping_leg.robot import GRAVITY, Boom, kinematics, load_robot
from studies.real_hops.recorded import RIGS, Hop, controllers_robot, force_of, load_hops
from studies.real_hops.run import RealHops, _coverage, errors, torque_errors
from studies.real_hops.simulated import fall_apex, simulate
from studies.shared import main

LEG = load_robot("legv2")
START = np.array([1.49, -2.2])
BOOM = log_format("legv2_boom").metadata.boom


def boom_hop(force=(75.0, 0.0), run="a", rise=0.3):
    """Return a hop as the boom's log would have it, of a constant force."""
    time = np.arange(100) / 130
    q = np.tile(START, (100, 1))
    torque = kinematics.jacobian(LEG, q).swapaxes(1, 2) @ np.array(force) * [1.0, 2.0]
    torque[:2] = 0.0
    torque[15:] = 0.0
    target, still = np.array([0.845, -1.891]), np.zeros((100, 2))
    course = rise * np.sin(np.pi * time / time[-1])
    command = np.concatenate([torque[2:3], torque[2:3], torque[2:]])
    return Hop(run, "boom, 130 Hz", time, q, still, torque, command, target, 0.2, 12, course, BOOM)


def test_forces_are_those_of_the_torques():
    hop = boom_hop()
    torque = hop.command / [1.0, 2.0]
    np.testing.assert_allclose(
        force_of(LEG, hop.q, torque)[:10], np.tile((75.0, 0.0), (10, 1)), atol=1e-9
    )


def test_a_flight_on_the_boom_falls_by_weight_over_inertia():
    (found,) = simulate([boom_hop((55.0, 0.0))], [LEG], by_law=True)
    inside = (found.time > found.lift_off_s + 0.2) & (found.time < found.touchdown_s - 0.03)
    curve = np.polyfit(found.time[inside], found.rise[inside], 2)
    leg = LEG.mass - BOOM.slider
    gravity = GRAVITY * (leg + BOOM.moment + BOOM.weight / GRAVITY) / (leg + BOOM.inertia)
    assert -2 * curve[0] == pytest.approx(gravity, rel=0.08)


@pytest.mark.parametrize("by_law", [False, True])
def test_more_force_hops_higher_and_more_mass_lower(by_law):
    hops = [boom_hop(), boom_hop((85.0, 0.0)), boom_hop()]
    heavy = [LEG, LEG, load_robot("legv2-paper")]
    plain, strong, _ = simulate(hops, heavy, by_law=by_law)
    assert strong.rise.max() > plain.rise.max() + 0.02
    weighed = Boom(mass=0.5, weight=2.0)
    (slow,) = simulate(hops[:1], [replace(LEG, boom=weighed)], by_law=by_law)
    assert slow.rise.max() < plain.rise.max() - 0.02


def test_a_hop_lands_where_it_was_recorded_to_land():
    hop = boom_hop()
    hop.rise[-3:] = -0.1
    (found,) = simulate([hop], [LEG], by_law=True)
    foot = kinematics.stance_height(LEG, found.q)
    fallen = found.rise[-1] - (foot[-1] - foot[0])
    assert fallen == pytest.approx(-0.1, abs=0.01)
    assert errors(hop, found)["apex"] == pytest.approx(found.rise.max() - hop.rise.max())


def test_the_rails_apex_is_that_of_its_flight():
    leg = load_robot("legv1")
    q = np.linspace([1.2, -2.5], [0.5, -1.0], 200)
    torque = kinematics.jacobian(leg, q).swapaxes(1, 2) @ np.array([50.0, 0.0])
    time, none = np.arange(200) / 630, np.full(200, np.nan)
    hop = Hop("r", "rail", time, q, 0 * q, torque, torque, q[0], 0.36, 150, none, Boom())
    (found,) = simulate([hop], [leg])
    flown = found.touchdown_s - found.lift_off_s
    miss = errors(hop, found)["apex"]
    assert miss == pytest.approx(fall_apex(flown) - fall_apex(49 / 630), abs=1e-6)
    assert (torque_errors(hop, found) >= 0).all()


def test_intervals_are_made_of_the_errors_of_other_runs():
    hops = [boom_hop(run=run, rise=0.3) for run in "aabb"]
    found = simulate(hops, [LEG] * 4, by_law=True)
    covered = _coverage(hops, found, [])
    assert covered["inside_90"] == 1.0
    assert covered["half_width_m"] == pytest.approx(0.0, abs=1e-9)


def test_without_recordings_the_sentence_says_what_to_name(monkeypatch, tmp_path, capsys):
    monkeypatch.delenv("HOPPING_LEG_RECORDINGS", raising=False)
    assert main("real_hops", RealHops, []) == 2
    assert "--recordings" in capsys.readouterr().err
    assert main("real_hops", RealHops, ["--recordings", str(tmp_path)]) == 2
    assert "legv2_boom" in capsys.readouterr().err


@needs_recordings
@pytest.mark.parametrize(
    ("rig", "target"), [("boom, 130 Hz", (0.845, -1.891)), ("boom, 200 Hz", (0.899, -1.937))]
)
def test_the_recorded_controllers_law_is_in_the_log(rig, target):
    """Its torques are those of a constant force, with the knee's behind the belt."""
    hops, robot = load_hops(RECORDINGS, rig), controllers_robot(rig)
    assert len(hops) >= 23
    for hop in hops:
        pushed = slice(1, hop.lift_off)
        old = hop.q[: hop.lift_off - 1]
        if np.abs(hop.command[pushed]).max() < RIGS[rig].limit:
            force = force_of(robot, old, hop.command[pushed] / [1.0, 2.0])
            assert np.ptp(force, axis=0).max() < 1e-3
        np.testing.assert_allclose(hop.target, target, atol=4e-3)
