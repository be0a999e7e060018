from dataclasses import replace

import pytest

from hopping_leg.controllers.energy_shaping import tuned_energy_shaping
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


def test_a_leg_gets_the_gains_that_were_tuned_on_it():
    for name in ("energy-shaping", "energy-shaping-flying"):
        own = tuned_energy_shaping(load_robot("legv2"), gains=name)
        assert own.gains == load_gains(f"{name}-legv2").gains
        assert own.name == name
        assert load_gains(f"{name}-legv2").robot == "legv2"


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


def test_forces_scale_with_mass_alone_and_on_the_same_leg_nothing_changes():
    gains, heavy = load_gains().gains, replace(ROBOT.base, mass=ROBOT.base.mass + ROBOT.mass)
    assert vars(scale_gains(gains, ROBOT, ROBOT)) == pytest.approx(vars(gains))
    scaled = scale_gains(gains, ROBOT, replace(ROBOT, base=heavy))
    assert scaled.touchdown_stiffness == pytest.approx(2 * gains.touchdown_stiffness)
    assert scaled.liftoff_length == pytest.approx(gains.liftoff_length)
    assert scaled.knee_stiffness == pytest.approx(gains.knee_stiffness)
