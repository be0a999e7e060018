"""What a study is of, and what is refused."""

from dataclasses import replace

import pytest

from hopping_leg.errors import RobotError, UsageError
from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real.methods import choose_methods
from hopping_leg.sim_to_real.study import TwinFile, find_twins
from tests.sim_to_real.studies import study


def test_drawn_twins_are_the_same_each_time_and_believed_to_be_the_cad(tmp_path):
    one, again = (find_twins(["2"], tmp_path) for _ in range(2))
    assert one == again
    assert [twin.believed for twin in one] == ["legv2", "legv2"]
    assert one[0].robot.digest != one[1].robot.digest
    assert not one[0].robot.reality.only_delays


def test_anyone_can_bring_a_twin(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nextends = "legv2-paper"\n')
    (twin, shipped) = find_twins([str(file), "twin"], tmp_path)
    assert (twin.name, twin.believed) == ("mine", "legv2-paper")
    assert shipped.name == "twin"
    for words, error in (
        (["0"], "too few"),
        (["legv2"], "extends no robot"),
        ([str(file), str(file)], "Two twins are called 'mine'"),
        (["legv9"], "There is no robot"),
    ):
        with pytest.raises((UsageError, RobotError), match=error):
            find_twins(words, tmp_path)


def test_a_twin_file_knows_who_it_is():
    twin = TwinFile("twin", "twin", "legv2-paper")
    assert twin.robot == load_robot("twin")
    assert twin.without_surprises.reality.only_delays
    hip = twin.without_surprises.hip
    assert replace(load_robot("legv2-paper").hip, armature=hip.armature) == hip


def test_trainings_that_do_not_depend_on_the_twin_are_shared(tmp_path):
    one = study(tmp_path, ("identified", "cad", "randomised"))
    folders = {m.name: {one.training(t, m, 0) for t in one.twins} for m in one.methods}
    assert {name: len(found) for name, found in folders.items()} == {
        "identified": 2, "cad": 1, "randomised": 1,
    }  # fmt: skip
    assert len(set.union(*folders.values())) == 4


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"seconds": 5.0}, "too short"),
        ({"steps": 0}, "at least 1"),
        ({"seeds": ()}, "each given once"),
        ({"seeds": (1, 1)}, "each given once"),
        ({"seeds": (-1,)}, "each given once"),
    ],
)
def test_options_without_meaning_are_refused(tmp_path, options, says):
    with pytest.raises(UsageError, match=says):
        study(tmp_path, **options)


def test_methods_are_checked():
    with pytest.raises(UsageError, match="Did you mean 'identified'"):
        choose_methods(["identifed"])
    with pytest.raises(UsageError, match="named twice"):
        choose_methods(["cad", "cad"])
    with pytest.raises(UsageError, match="No method"):
        choose_methods([])
