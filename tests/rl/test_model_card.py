import pytest

from hopping_leg.rl.model_card import MISSED, curriculum, missed_commands, teacher_scores
from hopping_leg.rl.recipes.precise import PRECISE


def trials(**errors):
    return [
        {"command_m": int(name[1:]) / 100, "median_error_m": error}
        for name, error in errors.items()
    ]


@pytest.mark.parametrize("error", [0.0, MISSED, -MISSED])
def test_a_policy_that_meets_its_commands_is_not_doubted(error):
    assert missed_commands(trials(_22=error, _30=0.001)) == ""


def test_a_card_names_every_command_that_its_own_simulation_misses():
    said = missed_commands(trials(_22=0.235, _25=0.004, _30=-0.021, _35=None))
    assert "0.22 m (+235 mm), 0.30 m (-21 mm), 0.35 m (no hops)" in said
    assert "0.25" not in said


def test_a_command_between_centimetres_is_not_rounded_to_another():
    assert "0.225 m (+30 mm)" in missed_commands([{"command_m": 0.225, "median_error_m": 0.03}])


def test_a_card_tells_how_teachers_did():
    assert teacher_scores([]) == ""
    assert "Evaluations of the teachers in order: 21.0, 4.1 mm" in teacher_scores([0.021, 0.0041])


def test_a_card_tells_who_learnt_until_when():
    stages = PRECISE.distillation.stages
    said = curriculum([stage._asdict() for stage in stages])
    assert "teacher 1 until 25 % (accepted from 7 mm)" in said
    assert "student until 100 %" in said
    assert curriculum([]) == ""
