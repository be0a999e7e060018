import pytest

from hopping_leg.errors import RobotError
from hopping_leg.robot import NO_MISMATCH, load_robot


def twin_file(tmp_path, text):
    file = tmp_path / "twin.toml"
    file.write_text(f'name = "t"\nextends = "legv2"\n{text}')
    return file


def test_shipped_legs_are_what_the_simulator_for_training_knows():
    assert load_robot("legv2").reality == NO_MISMATCH
    assert load_robot("legv2-paper").reality.neutral
    assert not load_robot("twin").reality.neutral


def test_a_part_may_be_left_out_and_stays_neutral(tmp_path):
    text = '[reality.knee]\nbacklash = { value = 0.002, unit = "rad", source = "[C]" }\n'
    reality = load_robot(twin_file(tmp_path, text)).reality
    assert reality.knee.backlash == 0.002
    assert reality.hip == NO_MISMATCH.hip
    assert reality.latency == NO_MISMATCH.latency


@pytest.mark.parametrize(
    ("table", "field", "value", "unit", "sentence"),
    [
        ("knee", "backlash", -0.1, "rad", "zero or more"),
        ("knee", "stiffness", 0.0, "N m/rad", "more than zero"),
        ("knee", "efficiency", 1.2, "1", "no gear gives more"),
        ("hip", "stiction", 0.5, "1", "give 1 or more"),
        ("hip", "torque_limit", 99.0, "N m", "hip.motor.peak_torque"),
        ("ground", "time_constant", 1e-4, "s", "two physics steps"),
        ("latency", "command", 0.01, "ms", "must be in 's'"),
        ("latency", "comand", 0.01, "s", "Did you mean 'command'"),
    ],
)
def test_mistakes_get_a_sentence(tmp_path, table, field, value, unit, sentence):
    entry = f'{field} = {{ value = {value}, unit = "{unit}", source = "[C]" }}'
    file = twin_file(tmp_path, f"[reality.{table}]\n{entry}\n")
    with pytest.raises(RobotError, match=sentence) as caught:
        load_robot(file)
    assert f"reality.{table}" in str(caught.value)
