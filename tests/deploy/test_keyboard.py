import pytest

from hopping_leg.deploy.keyboard import LiveHeight, handle_key


def test_keys_raise_lower_and_stop():
    height, stops = LiveHeight(0.30, (0.25, 0.35)), []
    for _ in range(3):
        handle_key(b"+", height, lambda: stops.append(1))
    assert height.at(0) == pytest.approx(0.33)
    for _ in range(20):
        handle_key(b"\x1b[B", height, lambda: stops.append(1))
    assert height.at(0) == 0.25
    assert handle_key(b"x", height, lambda: stops.append(1)) == ""
    assert handle_key(b"+", None, lambda: stops.append(1)) == ""
    assert not stops
    for key in (b" ", b"q", b"\n"):
        assert handle_key(key, height, lambda: stops.append(1)) == "stopping"
    assert len(stops) == 3
