"""Who may use the page, and what it may ask for: nothing but what it was offered."""

import asyncio
import http.client
import itertools
from types import SimpleNamespace

import pytest

pytest.importorskip("viser", reason="the extra 'view' is not installed")

import viser
import websockets
from websockets.datastructures import Headers
from websockets.http11 import Request

from hopping_leg.viewer.live_leg import LiveSimulation
from hopping_leg.viewer.panels import Inputs, LivePanel
from hopping_leg.viewer.viewer import Viewer, answer

OWN = ("127.0.0.1:8080", "localhost:9000", "[::1]:1", "localhost")
FOREIGN = ("elsewhere.example", "127.0.0.1.elsewhere.example:8080", "192.168.0.7:8080", "", "[")


def request(host, origin, *, upgrade):
    headers = Headers({"Host": host})
    if origin is not None:
        headers["Origin"] = origin
    if upgrade:
        headers["Upgrade"] = "websocket"
    return Request("/", headers)


@pytest.mark.parametrize("upgrade", [False, True])
def test_this_computers_page_alone_is_served_and_only_to_itself(upgrade):
    for host, other in itertools.product(OWN + FOREIGN, (*OWN, *FOREIGN, None)):
        origin = None if other is None else f"http://{other}"
        served, asked = SimpleNamespace(headers=Headers()), request(host, origin, upgrade=upgrade)
        answered = answer(lambda *_, served=served: served, None, asked)
        fits = host in OWN and (other == host or (other is None and not upgrade))
        assert (answered is served) is fits, (host, origin)
        assert answered.headers["X-Frame-Options"] == "DENY"


def page_at(port):
    return Viewer(LiveSimulation(("energy-shaping",), "legv2-paper", 0.3), port=port)


@pytest.fixture
def served():
    """Host and port of a live simulation's page."""
    viewer = page_at(0)
    yield viewer.address.removeprefix("http://").split(":")
    viewer.close()


def test_the_served_page_and_its_websocket_are_guarded_and_a_taken_port_gives_another(served):
    host, port = served
    assert host == "127.0.0.1"
    other = page_at(int(port))
    assert other.address not in (f"http://{host}:{port}", f"http://{host}:0")
    other.close()
    for name, status in ((f"{host}:{port}", 200), ("elsewhere.example", 403)):
        connection = http.client.HTTPConnection(host, port, timeout=30)
        connection.request("GET", "/", headers={"Host": name})
        assert connection.getresponse().status == status

    async def knock(origin):
        async with websockets.connect(
            f"ws://{host}:{port}", origin=origin, subprotocols=["viser-v0"]
        ):
            return True

    assert asyncio.run(knock(f"http://{host}:{port}"))
    for origin in (None, "http://elsewhere.example"):
        with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
            asyncio.run(knock(origin))


_KNOCK = """address => new Promise(done => {
  const socket = new WebSocket(address, ["viser-v0"]);
  socket.onopen = () => done("open");
  socket.onerror = socket.onclose = () => done("refused");
})"""
_READ = "address => fetch(address).then(page => page.text(), () => 'refused')"
_FRAME = """address => new Promise(done => {
  const frame = document.createElement("iframe");
  [frame.src, frame.onload] = [address, done];
  document.body.append(frame);
})"""


@pytest.mark.slow
def test_a_page_of_another_site_can_neither_read_nor_show_nor_steer_it(foreign, served):
    page, socket = (f"{kind}://{':'.join(served)}" for kind in ("http", "ws"))
    assert foreign.evaluate(_KNOCK, socket) == "refused"
    assert foreign.evaluate(_READ, page) == "refused"
    foreign.evaluate(f"address => void ({_FRAME})(address)", page)
    foreign.wait_for_timeout(1000)
    assert not any("viser" in frame.content() for frame in foreign.frames[1:])
    foreign.goto(page, wait_until="commit")  # its own page may
    assert foreign.evaluate(_KNOCK, socket) == "open"
    assert "<html" in foreign.evaluate(_READ, page)


def test_the_page_cannot_name_a_file_or_a_class(tmp_path):
    plug_in, mark = tmp_path / "mine.py", tmp_path / "loaded"
    plug_in.write_text(f"open({str(mark)!r}, 'w')\n")
    server = viser.ViserServer(port=0, verbose=False)
    live, inputs = LiveSimulation(("energy-shaping",), "legv2-paper", 0.3), Inputs(server)
    panel = LivePanel(inputs, live)
    for handle, name in itertools.product(
        (panel._first, panel._second, panel._robot), (f"{plug_in}:Mine", "/etc/passwd", "x.toml")
    ):
        before = (live.names, live.robot)
        shown, handle._impl.value = handle.value, name
        inputs.put(panel._begin)
        (complaint,) = inputs.run()
        assert "does not offer" in complaint
        assert (live.names, live.robot) == before
        handle._impl.value = shown
    assert not mark.exists()
    server.stop()
