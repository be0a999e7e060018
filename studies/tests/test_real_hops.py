import numpy as np
import pytest
from tests.identify.runs import RECORDINGS, needs_recordings

from hopping_leg.robot import GRAVITY, kinematics, load_robot
from studies.real_hops.recorded import Hop, force_of, load_hops
from studies.real_hops.run import RealHops, _fitted, errors, torque_errors
from studies.real_hops.simulated import simulate
from studies.shared import main

LEG = load_robot("legv2")
START = np.array([1.49, -2.2])


def boom_hop(force=(45.0, 20.0), run="a", rise=0.3):
    """Return a hop as the boom's log would have it, of a constant force."""
    time = np.arange(100) / 130
    q = np.tile(START, (100, 1))
    torque = kinematics.jacobian(LEG, q).swapaxes(1, 2) @ np.array(force)
    target, still = np.array([0.845, -1.891]), np.zeros((100, 2))
    course = rise * np.sin(np.pi * time / time[-1])
    return Hop(run, "boom", time, q, still, torque, torque, target, 0.2, 12, 99, course)


def test_forces_are_those_of_the_torques():
    hop = boom_hop()
    np.testing.assert_allclose(force_of(LEG, hop.q, hop.command), np.tile((45.0, 20.0), (100, 1)))


def test_a_flight_on_the_boom_is_a_parabola_of_its_effective_gravity():
    found = simulate(boom_hop(), LEG)
    inside = (found.time > found.lift_off_s + 0.3) & (found.time < found.touchdown_s - 0.03)
    curve = np.polyfit(found.time[inside], found.rise[inside], 2)
    assert -2 * curve[0] == pytest.approx(4.5, rel=0.05)


def test_more_torque_hops_higher_and_more_mass_lower():
    hop = boom_hop()
    plain, strong, heavy = (simulate(hop, LEG, *how) for how in ((), (1.2,), (1.0, 0.5)))
    assert heavy.rise.max() < plain.rise.max() < strong.rise.max()
    assert strong.lift_off_s <= plain.lift_off_s <= heavy.lift_off_s


def test_a_push_on_the_rail_gives_what_the_motors_gave_at_that_length():
    leg = load_robot("legv1")
    q = np.linspace([1.2, -2.5], [0.5, -1.0], 200)
    torque = kinematics.jacobian(leg, q).swapaxes(1, 2) @ np.array([50.0, 0.0])
    time, none = np.arange(200) / 630, np.full(200, np.nan)
    hop = Hop("r", "rail", time, q, 0 * q, torque, torque, q[0], 0.36, 150, 199, none)
    found = simulate(hop, leg)
    pushed = found.time < found.lift_off_s - 0.01
    force = force_of(leg, found.q[pushed], found.torque[pushed])
    np.testing.assert_allclose(force[5:, 0], 50.0, rtol=0.1)
    fall = found.touchdown_s - found.lift_off_s
    assert found.rise.max() - found.rise[~pushed][0] == pytest.approx(
        GRAVITY * fall**2 / 8, rel=0.5
    )


def test_what_fits_the_other_runs_judges_a_run(monkeypatch):
    monkeypatch.setattr("studies.real_hops.run.GAINS", {"boom": np.array([0.8, 1.2])})
    monkeypatch.setattr("studies.real_hops.run.EXTRAS", {"boom": (0.0,)})
    weak, strong = (simulate(boom_hop(), LEG, gain).rise.max() for gain in (0.8, 1.2))
    hops = [boom_hop(run="low", rise=weak), boom_hop(run="high", rise=strong)]
    found, chosen = _fitted(hops, LEG, "boom")
    assert [gain for gain, _ in chosen] == [1.2, 0.8]
    assert errors(hops[0], found[0])["apex"] == pytest.approx(strong - weak, abs=1e-3)
    assert (torque_errors(hops[0], found[0]) > 0).all()


def test_without_recordings_the_sentence_says_what_to_name(monkeypatch, tmp_path, capsys):
    monkeypatch.delenv("HOPPING_LEG_RECORDINGS", raising=False)
    assert main("real_hops", RealHops, []) == 2
    assert "--recordings" in capsys.readouterr().err
    assert main("real_hops", RealHops, ["--recordings", str(tmp_path)]) == 2
    assert "legv2_boom" in capsys.readouterr().err


@needs_recordings
def test_the_recorded_controllers_law_is_in_the_log():
    hops = load_hops(RECORDINGS, "boom")
    assert len(hops) == 23
    for hop in hops:
        pushed = slice(1, hop.lift_off)
        old = hop.q[: hop.lift_off - 1]
        force = force_of(LEG, old, hop.command[pushed])
        assert np.ptp(force, axis=0).max() < 1e-3
        np.testing.assert_allclose(hop.target, [0.845, -1.891], atol=2e-3)
    assert len(load_hops(RECORDINGS, "rail")) == 18
