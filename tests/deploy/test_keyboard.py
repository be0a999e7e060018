"""Keys: a stop key stops whatever else arrives with it, and so does the end of all input."""

import contextlib
import os
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.deploy.keyboard import LiveHeight, handle_keys, keys

HEIGHT_KEYS = (b"+", b"-", b"j", b"k", b"\x1b[A", b"\x1b[B", b"\x1bOA")
OTHERS = (*(bytes([key]) for key in b" qQ\r\n\x1bx\x04\x00"), b"\x1b[C", "\u00e4".encode())


@given(
    st.lists(st.sampled_from(HEIGHT_KEYS + OTHERS), max_size=6), st.booleans(), st.integers(0, 6)
)
def test_a_stop_key_stops_among_any_others_and_height_keys_alone_do_not(pressed, live, at):
    stops, height = [], LiveHeight(0.30, (0.22, 0.40)) if live else None
    for other in (None, *OTHERS):
        found = [*pressed[:at], *([other] if other else []), *pressed[at:]]
        stops.clear()
        words = handle_keys(b"".join(found), height, lambda: stops.append(1))
        assert bool(stops) is (not found or any(key in OTHERS for key in found))
        assert (words == "stopping") is bool(stops)


def test_keys_raise_and_lower_within_the_range_also_many_at_once():
    height, stop = LiveHeight(0.30, (0.25, 0.35)), pytest.fail
    assert handle_keys(b"+++-", height, stop) == "height 0.32 m"
    assert handle_keys(b"\x1b[B" * 40, height, stop) == "height 0.25 m"
    assert handle_keys(b"+", None, stop) == ""


@contextlib.contextmanager
def listening(monkeypatch, stdin):
    """Listen to an input while the display is gone; yield the stops."""
    stops = []

    def show(words):
        raise OSError("the terminal is gone")

    monkeypatch.setattr(sys, "stdin", stdin)
    with keys(None, lambda: stops.append(1), show):
        yield stops


def stopped(stops):
    end = time.monotonic() + 10
    while not stops and time.monotonic() < end:
        time.sleep(0.01)
    return bool(stops)


@pytest.fixture(params=["terminal", "pipe"])
def ends(request):
    """The operator's and the program's end of an input."""
    ours, theirs = os.openpty() if request.param == "terminal" else reversed(os.pipe())
    yield ours, theirs
    for end in (ours, theirs):
        with contextlib.suppress(OSError):
            os.close(end)


@pytest.fixture
def stops(monkeypatch, ends):
    """Stops that are asked for at that input."""
    with os.fdopen(ends[1], "rb", closefd=False) as stdin, listening(monkeypatch, stdin) as found:
        yield found


def test_a_key_that_is_pressed_arrives_also_where_the_display_fails(ends, stops):
    os.write(ends[0], b"+")
    time.sleep(0.3)
    assert not stops
    os.write(ends[0], b"+ bnm")
    assert stopped(stops)


@pytest.mark.parametrize("closed", [(0,), (1, 0)])
def test_an_input_that_ends_stops_once_and_nothing_is_raised(ends, stops, closed):
    for end in closed:
        os.close(ends[end])
    assert stopped(stops)
    time.sleep(0.3)
    assert len(stops) == 1


@pytest.mark.parametrize("closed", [True, False])
def test_where_nobody_can_press_a_key_nothing_stops(monkeypatch, closed):
    with open(os.devnull) as nothing, listening(monkeypatch, None if closed else nothing) as stops:  # noqa: PTH123
        time.sleep(0.3)
        assert not stops
