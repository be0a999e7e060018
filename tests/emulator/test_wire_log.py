import moteus
import pytest

from tests.emulator.bench import Bench, R

STATE = (R.MODE, R.FAULT, R.VOLTAGE, R.TEMPERATURE)


def test_an_answer_is_noted_as_it_travels():
    bench = Bench()
    bench.robot.drives[0].disturbances.temperature = 35.04
    assert bench.robot.drives[0].temperature > 65.0
    bench.read(*STATE, resolution=moteus.INT16)
    bench.read(*STATE, resolution=moteus.F32)
    rounded, exact = bench.robot.log.answers
    assert rounded.temperature == 65.0
    assert exact.temperature == pytest.approx(65.04)


def test_an_answer_that_does_not_tell_the_state_is_not_noted():
    bench = Bench()
    bench.read(R.POSITION, R.TEMPERATURE)
    assert not bench.robot.log.answers
