import logging
import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hopping_leg import cli
from hopping_leg.errors import RobotError
from hopping_leg.io import replace_at
from hopping_leg.robot import doubts, load_robot, load_tree, numbers, shipped_robots
from tests.robot.files import written

EXAMPLE = "examples/my_leg.toml"


@pytest.mark.parametrize("name", [*shipped_robots(), EXAMPLE])
def test_nobody_doubts_what_is_shipped(name):
    assert doubts(name) == []


GEAR = ("knee.motor.gear_ratio", (9.0, "1"))


@pytest.mark.parametrize(
    ("change", "computed"),
    [
        (GEAR, True),
        (("knee.belt_ratio", (3.0, "1")), True),
        (("knee.motor.gear_ratio", (6.0, "1")), False),  # as it was
        (("knee.friction", (0.1, "N m")), False),
    ],
)
def test_an_inherited_armature_holds_for_its_own_gear_alone(tmp_path, change, computed):
    file = written(tmp_path / "leg.toml", dict([change]))
    knee = load_robot(file).knee
    follows = knee.motor.rotor_inertia * (knee.motor.gear_ratio * knee.belt_ratio) ** 2
    assert knee.armature == pytest.approx(follows if computed else 0.0001)
    assert any("knee.armature" in doubt for doubt in doubts(file)) == computed


def test_an_armature_that_the_file_states_for_its_gear_is_inherited_with_it(tmp_path):
    written(tmp_path / "leg.toml", dict([GEAR, ("knee.armature", (0.02, "kg m2"))]))
    grandchild = written(tmp_path / "other.toml", {"base.mass": (1.0, "kg")}, "leg.toml")
    assert load_robot(grandchild).knee.armature == 0.02


@pytest.mark.parametrize(
    ("path", "value", "belong"),
    [
        ("thigh.length", (0.2, "m"), ("thigh.com", "thigh.inertia")),
        ("shank.mass", (0.2, "kg"), ("shank.com", "shank.inertia")),
        ("knee.motor.gear_ratio", (9.0, "1"), ("knee.motor.no_load_speed", "knee.armature")),
    ],
)
def test_numbers_that_belong_to_a_changed_one_are_named_until_stated(tmp_path, path, value, belong):
    file = written(tmp_path / "leg.toml", {path: value})
    (sentence,) = doubts(file)
    assert all(word in sentence for word in (file, path, "legv2-paper", *belong))
    entries = dict(numbers(load_tree(file)))
    named = sentence.split(" but not ")[1].split(", inherited")[0].split(", ")
    stated = {n: (entries[n]["value"], entries[n]["unit"]) for n in named if n in entries}
    stated.setdefault("knee.armature", (0.01, "kg m2"))
    assert doubts(written(tmp_path / "leg.toml", {path: value, **stated})) == []


def said(file):
    """Return what is doubted in a robot file, or why it is refused."""
    try:
        return doubts(file)
    except RobotError as error:
        return [str(error)]


OTHER_UNITS = {
    "kg": (1e3,), "m": (1e3, 1e2, 39.37), "kg m2": (1e9, 1e7, 1e4), "N m": (1e3,),
    "rad/s": (30 / math.pi, 180 / math.pi), "rad": (180 / math.pi,),
}  # fmt: skip
"""Values in other units for one in SI."""
ENTRIES = [(p, e) for p, e in numbers(load_tree("legv2")) if e["unit"] in OTHER_UNITS]


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(number=st.sampled_from(ENTRIES), data=st.data())
def test_a_value_in_another_unit_is_doubted_where_it_stands(tmp_path, number, data):
    path, entry = number
    factor = data.draw(st.sampled_from(OTHER_UNITS[entry["unit"]]))
    value = (entry["value"] * factor, entry["unit"])
    found = said(written(tmp_path / "leg.toml", {path: value}, "legv2"))
    exact = path.endswith((".mass", ".length", ".rotor_inertia"))
    named = f"'{path}'" if exact else f"'{path.partition('.')[0]}."
    assert any(named in sentence for sentence in found)


@pytest.mark.parametrize(("upper", "doubted"), [(-0.1, True), (0.25, True), (0.9, False)])
def test_a_leg_whose_foot_never_comes_below_the_hip_is_doubted(tmp_path, upper, doubted):
    limits = {"hip.lower": (-1.2, "rad"), "hip.upper": (upper, "rad")}
    found = doubts(written(tmp_path / "leg.toml", limits))
    assert any("never comes below the hip" in doubt for doubt in found) == doubted


def test_a_leg_too_heavy_for_its_motors_is_doubted_with_the_torque_that_standing_takes(tmp_path):
    (doubt,) = doubts(written(tmp_path / "leg.toml", {"base.mass": (20.0, "kg")}))
    lever = load_robot("legv2").thigh.length * math.sin(0.7)  # about half of the knee's bend
    needed = float(doubt.partition("takes ")[2].split()[0])
    assert needed == pytest.approx(20.9 * 9.81 * lever, rel=0.1)
    assert "its torque limit is 20 N m" in doubt
    (drag,) = doubts(written(tmp_path / "leg.toml", {"knee.damping": (9.0, "N m s/rad")}))
    assert "'knee.damping' is 9, which hardly fits" in drag


def test_a_weight_beyond_a_links_end_needs_a_word(tmp_path):
    out = {"shank.com": (0.16, "m"), "shank.inertia": (2e-4, "kg m2")}
    (sentence,) = said(written(tmp_path / "leg.toml", out, "legv2"))
    assert "'shank.com' is 0.16 but must lie between 0 and 0.14: 'shank.length'" in sentence
    extended = written(tmp_path / "leg.toml", {**out, "shank.extent": (0.2, "m")}, "legv2")
    assert doubts(extended) == []
    assert load_robot(extended).shank.com == 0.16
    plain = load_robot("legv2")
    assert replace_at(plain, "shank.extent", 0.2).digest == plain.digest


def test_a_command_says_doubts_once_on_stderr_and_check_says_them_all(tmp_path, caplog, capsys):
    file = written(tmp_path / "leg.toml", {"shank.mass": (0.2, "kg")})
    with caplog.at_level(logging.WARNING):
        load_robot(file)
        load_robot(file)
    assert [record.message for record in caplog.records] == doubts(file)
    for verb in ("check", "show"):
        assert cli.main(["robots", verb, file]) == 0
        assert doubts(file)[0] in capsys.readouterr().out
