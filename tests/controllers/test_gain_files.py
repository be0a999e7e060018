from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers.energy_shaping.gains import (
    GainFile,
    ShapingGains,
    load_gains,
    save_gains,
    scale_gains,
)
from hopping_leg.errors import UsageError
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")


def test_gains_survive_a_file(tmp_path):
    stored = GainFile("legv2", 'a "quoted" search', ShapingGains(k0=1.25, exponent=0.5))
    save_gains(tmp_path / "g.toml", stored)
    assert load_gains(tmp_path / "g.toml") == stored


@pytest.mark.parametrize("name", ["energy-shaping", "by-hand"])
def test_shipped_gains_name_their_leg_and_source(name):
    found = load_gains(name)
    assert load_robot(found.robot).mass > 0
    assert found.source


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('robot = "a"\nsource = "b"\n[gains]\nk_0 = 1.0', "k_0"),
        ('robot = "a"\nsource = "b"\n[gains]\nk0 = nan', "finite"),
        ('robot = "a"\nsource = "b"\n[gains]\nk0 = "1"', "finite"),
        ('robot = "a"\n[gains]\nk0 = 1.0', "source"),
        ('robot = "a"\nsource = "b"', "[gains]"),
        ("robot = ", "TOML"),
        (None, "hop tune"),
    ],
)
def test_bad_gain_files_are_named(tmp_path, text, said):
    path = tmp_path / "bad.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UsageError) as caught:
        load_gains(path)
    assert said in str(caught.value)


def test_scaling_to_the_same_leg_changes_nothing():
    gains = load_gains().gains
    scaled = scale_gains(gains, ROBOT, ROBOT)
    for name, value in vars(gains).items():
        assert getattr(scaled, name) == pytest.approx(value), name


def test_forces_scale_with_mass_alone():
    heavy = replace(ROBOT, base=replace(ROBOT.base, mass=ROBOT.base.mass + ROBOT.mass))
    gains = scale_gains(load_gains().gains, ROBOT, heavy)
    assert gains.touchdown_stiffness == pytest.approx(2 * load_gains().gains.touchdown_stiffness)
    assert gains.liftoff_length == pytest.approx(load_gains().gains.liftoff_length)
    assert np.isclose(gains.knee_stiffness, load_gains().gains.knee_stiffness)
