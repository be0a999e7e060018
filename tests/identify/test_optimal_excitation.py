import dataclasses
import math

import numpy as np
import pytest

from hopping_leg.cli import main
from hopping_leg.errors import UsageError
from hopping_leg.identify import play_excitation
from hopping_leg.identify.excitation import (
    HardwareRange,
    load_excitation,
    make_excitation,
)
from hopping_leg.identify.optimal_excitation import Design, optimal_excitation
from hopping_leg.identify.pipeline import identify
from hopping_leg.robot import kinematics, load_robot
from tests.identify.twin import noisy

ROBOT = load_robot("legv2")
NOISE = {"position_rad": 1e-4, "velocity_rad_s": 0.06, "torque_nm": 0.045}


def total(expected):
    """Return the error of all parameters in changes that matter."""
    return math.hypot(*(error / parameter.scale for parameter, error in expected.items()))


def waved(rig, duration=7.5, size=1.0):
    """Return some harmonics that the leg can follow."""
    design = Design(ROBOT, rig, duration)
    rng = np.random.default_rng(3)
    while True:
        harmonics = design.harmonics(0.5 * rng.standard_normal(len(design.space[0])))
        smaller = harmonics and dataclasses.replace(harmonics, waves=size * harmonics.waves)
        if smaller and design.expected(smaller):
            return design, smaller


@pytest.mark.parametrize("rig", ["fixed-base", "rail"])
def test_a_search_lowers_the_expected_error_and_repeats_itself(rig):
    design, found = Design(ROBOT, rig, 7.5), []
    for generations in (1, 4, 4):
        _, expected = optimal_excitation(design, generations=generations, population=6, seed=1)
        found.append(total(expected))
    assert found[2] == found[1] < found[0]


@pytest.mark.parametrize("rig", ["fixed-base", "rail"])
def test_the_leg_begins_and_ends_at_rest_and_keeps_its_distance(rig):
    limits = HardwareRange(hip=(-1.0, 1.6), knee=(-2.4, -0.3))
    design = Design(ROBOT, rig, 15.0, limits=limits)
    harmonics, _ = optimal_excitation(design, generations=3, population=6)
    excitation = make_excitation(harmonics, ROBOT, limits=limits)
    lower, upper = np.array([limits.hip, limits.knee]).T
    assert (excitation.position > lower + 0.05).all()
    assert (excitation.position < upper - 0.05).all()
    assert np.abs(excitation.position[1] - excitation.position[0]).max() < 1e-3
    played = play_excitation.play(excitation, ROBOT, believed="legv2")
    assert (np.abs(played.array("torque")) < 0.85 * ROBOT.of_joints("torque_limit")).all()
    assert (np.abs(played.array("velocity")) < 0.85 * ROBOT.of_joints("no_load_speed")).all()
    if rig == "rail":
        foot = kinematics.foot_position(ROBOT, excitation.position)
        np.testing.assert_allclose(foot[:, 1], foot[0, 1], atol=1e-9)
        height = played.trace.column("height_m")
        assert kinematics.foot_clearance(ROBOT, height, played.array("position")).max() < 0.15


def test_twice_the_motion_and_four_times_the_length_tell_more():
    design, small = waved("fixed-base", size=0.5)
    large = dataclasses.replace(small, waves=2 * small.waves)
    assert total(design.expected(large)) < 0.8 * total(design.expected(small))
    longer = dataclasses.replace(design, duration=30.0)
    expected = longer.expected(dataclasses.replace(small, duration=30.0))
    assert total(expected) == pytest.approx(total(design.expected(small)) / 2, rel=0.05)


def test_noise_that_the_robot_file_states_counts():
    design, harmonics = waved("fixed-base")
    sensor = dataclasses.replace(ROBOT.reality.hip.sensor, torque_noise=3.0)
    drive = dataclasses.replace(ROBOT.reality.hip, sensor=sensor)
    noisier = dataclasses.replace(ROBOT, reality=dataclasses.replace(ROBOT.reality, hip=drive))
    other = dataclasses.replace(design, robot=noisier)
    assert total(other.expected(harmonics)) > 5 * total(design.expected(harmonics))


@pytest.mark.slow
def test_fits_err_as_expected():
    """Fits to noisy recordings of the believed robot itself scatter by what was expected."""
    design, harmonics = waved("fixed-base", 15.0)
    run = play_excitation.play(make_excitation(harmonics, ROBOT), ROBOT, believed="legv2")
    errors = []
    for seed in range(12):
        found = identify([noisy(run, seed, **NOISE)], ROBOT).identifiability
        errors.append(found.values)
    expected = design.expected(harmonics)
    spread = np.std(errors, axis=0) / list(expected.values())
    assert [p.name for p in expected] == found.names
    assert 0.6 < np.median(spread) < 1.7


def test_the_command_writes_it_and_says_what_it_tells(tmp_path, capsys):
    file, numbers = tmp_path / "air.parquet", tmp_path / "air.json"
    words = ["excite", "optimal", "--generations", "1", "--out", str(file), "--duration"]
    assert main([*words, "8", "--json", str(numbers)]) == 0
    assert load_excitation(file).rig == "fixed-base"
    assert '"name": "knee.armature"' in numbers.read_text()
    assert "expected error" in capsys.readouterr().out
    assert main([*words, "1"]) == 2
    assert "'duration' is 1 s but must be 7.5 s or more" in capsys.readouterr().err


def test_ranges_that_leave_no_room_are_refused():
    design = Design(ROBOT, limits=HardwareRange(hip=(0.0, 0.1)))
    with pytest.raises(UsageError, match="wider ranges"):
        optimal_excitation(design, generations=1, population=4)
