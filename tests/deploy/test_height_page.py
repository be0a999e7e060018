"""The height that the operator changes by the page's slider; only its own page may."""

import json
import socket
import urllib.error
import urllib.request

import pytest

from hopping_leg.deploy.height_page import HeightPage
from hopping_leg.deploy.keyboard import LiveHeight
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


@pytest.mark.parametrize("body", [b"", b"[", b"{}", b'"x"', b"\xff"])
def test_a_stop_stops_whatever_it_says(running, body):
    page, _, stops = running
    urllib.request.urlopen(page.address + "/stop", body, timeout=5).close()
    assert stops == ["stop"]


@pytest.mark.parametrize(("asked", "given"), [(0.35, 0.35), (9, 0.40), (-1.0, 0.22)])
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
        ("/height", {"height": float("inf")}, {}, 400),
        ("/height", {"height": float("nan")}, {}, 400),
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


@pytest.mark.parametrize(
    "body",
    [b"[" * 900, b'{"height": 1' + b"0" * 400 + b"}", b'{"height": ' + b"9" * 980 + b"}", b"\xff"],
)
@pytest.mark.parametrize("length", [None, "-1", "9" * 5000, "1e3", "2000"])
def test_what_is_too_large_or_no_request_is_answered_400_and_without_a_word(
    running, capfd, body, length
):
    page, height, _ = running
    host, port = page.address.removeprefix("http://").split(":")
    head = f"POST /height HTTP/1.0\r\nHost: {host}:{port}\r\n"
    head += f"Content-Length: {len(body) if length is None else length}\r\n\r\n"
    with socket.create_connection((host, int(port)), 10) as client:
        client.sendall(head.encode() + body)
        client.shutdown(socket.SHUT_WR)
        assert client.recv(100).startswith(b"HTTP/1.0 400")
    assert height.at(0.0) == 0.30
    assert capfd.readouterr().err == ""


def test_no_page_may_show_it_in_a_frame_nor_read_it_under_another_name(running):
    page = running[0]
    with urllib.request.urlopen(page.address, timeout=5) as reply:
        assert reply.headers["X-Frame-Options"] == "DENY"
    with pytest.raises(urllib.error.HTTPError, match="403"):
        ask(page, "/height", Host="elsewhere.example")


def test_a_port_that_is_taken_is_said_before_anything_moves(running):
    page, height, _ = running
    with pytest.raises(UsageError, match="give a free one"):
        HeightPage(height, int(page.address.rsplit(":", 1)[1]))
    with pytest.raises(UsageError, match="give a free one"):
        HeightPage(height, 70000)
