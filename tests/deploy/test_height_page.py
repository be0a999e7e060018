"""The height that the operator changes, by keys or by the page's slider; only its own page may."""

import json
import urllib.error
import urllib.request

import pytest

from hopping_leg.deploy.height_page import HeightPage
from hopping_leg.deploy.keyboard import LiveHeight, handle_key
from hopping_leg.errors import UsageError


@pytest.fixture
def running():
    height, stops = LiveHeight(0.30, (0.22, 0.40)), []
    page = HeightPage(height, 0)
    with page.serve(lambda: stops.append("stop")):
        yield page, height, stops


def ask(page, path, body=None, **headers):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(page.address + path, data, headers)
    with urllib.request.urlopen(request, timeout=5) as reply:
        return reply.read()


def test_the_page_tells_the_height_and_its_button_stops_the_leg(running):
    page, _, stops = running
    assert b"<input" in ask(page, "/")
    state = json.loads(ask(page, "/height"))
    assert state == {"height": 0.30, "low": 0.22, "high": 0.40, "stopping": False}
    assert json.loads(ask(page, "/stop", {}))["stopping"]
    assert stops == ["stop"]


@pytest.mark.parametrize(
    ("asked", "given"), [(0.35, 0.35), (9, 0.40), (-1.0, 0.22), (float("nan"), 0.30)]
)
def test_the_slider_moves_the_height_within_its_range(running, asked, given):
    page, height, _ = running
    state = json.loads(ask(page, "/height", {"height": asked}))
    assert state["height"] == given == height.at(0.0)


@pytest.mark.parametrize(
    ("path", "body", "headers", "status"),
    [
        ("/height", {"height": 0.35}, {"Origin": "http://elsewhere.example"}, 403),
        ("/height", {"height": 0.35}, {"Host": "elsewhere.example"}, 403),
        ("/height", {"height": "high"}, {}, 400),
        ("/height", {"height": True}, {}, 400),
        ("/height", [0.35], {}, 400),
        ("/height.json", None, {}, 404),
    ],
)
def test_others_and_nonsense_change_nothing(running, path, body, headers, status):
    page, height, stops = running
    with pytest.raises(urllib.error.HTTPError) as refusal:
        ask(page, path, body, **headers)
    assert refusal.value.code == status
    assert height.at(0.0) == 0.30
    assert not stops


def test_a_port_that_is_taken_is_said_before_anything_moves(running):
    page, height, _ = running
    with pytest.raises(UsageError, match="give a free one"):
        HeightPage(height, int(page.address.rsplit(":", 1)[1]))
    with pytest.raises(UsageError, match="give a free one"):
        HeightPage(height, 70000)


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
