"""The page and the loop behind it: who may ask, what is asked, what passes, what is shown.

viser serves whoever connects, and any page that this computer's browser shows could. So every
request, that for the websocket too, is first asked whether it comes from this computer's browser
and the page's own address: nothing else steers the leg.
"""

import contextlib
import functools
import html
import http
import io
import itertools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import patch
from urllib.parse import urlsplit

import viser
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from hopping_leg.errors import UsageError
from hopping_leg.figures import COLOURS, rgb
from hopping_leg.sim import CONTROL_RATE
from hopping_leg.viewer import live_leg, panels, scene, tracks

_HOST = "127.0.0.1"
_OWN = ("localhost", "127.0.0.1", "::1")
FRAME_RATE = 60.0
_SLOW = 5  # Pictures per update of each plot and of the text; they take turns
_NOTICE_SECONDS = 8.0


Source = live_leg.LiveSimulation | tracks.ReplaySource
"""Each has ``tracks``, the time ``now`` that is shown, s, and ``notices`` to be told."""


class Viewer:
    """Serves the page of a source from when it is made; nothing moves before ``run``.

    Where the port is in use, it is the next free one; UsageError says that there is no such port.
    """

    def __init__(self, source: Source, *, port: int = 8080) -> None:
        self._source = source
        if not 0 <= port < 65536:
            raise UsageError(f"--port is {port} but must lie between 0 and 65535.")
        with contextlib.redirect_stdout(io.StringIO()), _guarded():
            self._server = viser.ViserServer(host=_HOST, port=port, verbose=False)
        self.address = f"http://{_HOST}:{self._server.get_port()}"
        self.clock = panels.PlaybackClock(1 / CONTROL_RATE)
        self._inputs = panels.Inputs(self._server)
        gui = self._server.gui
        brand = rgb(COLOURS[0])
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=brand)
        gui.set_panel_label("Hopping leg")
        gui.main_panel.dock_left()
        gui.main_panel.set_width(310)
        self._status = gui.add_html("")
        self._replay_panel: panels.ReplayPanel | None = None
        if isinstance(source, live_leg.LiveSimulation):
            panels.LivePanel(self._inputs, source)
        if isinstance(source, tracks.ReplaySource):
            self._replay_panel = panels.ReplayPanel(self._inputs, source)
        panels.add_time_controls(self._inputs, self.clock)
        panel = gui.add_panel()
        self._scene = scene.Scene(self._server, panel.add_tab("Last seconds"))
        panel.dock_right()
        panel.set_width(390)
        self._frames = 0
        self._stopped = False

    def run(self, seconds: float = math.inf) -> None:
        """Simulate and show until the time is over, ``stop`` or Ctrl-C."""
        begun = last = next_at = time.monotonic()
        while last - begun < seconds and not self._stopped:
            self._source.notices += self._inputs.run()
            now = time.monotonic()
            self._source.advance(self.clock.due(now - last))
            last = now
            self.render()
            next_at = max(next_at + 1 / FRAME_RATE, time.monotonic())
            time.sleep(max(next_at - time.monotonic(), 0.0))

    def render(self) -> None:
        """Show what is now; plots and text every few frames."""
        source, turn = self._source, self._frames % _SLOW
        self._scene.show(source.tracks, source.now, turn)
        if turn == _SLOW - 1:
            self._status.content = self._text()
            if self._replay_panel is not None:
                self._replay_panel.show()
            clients = self._server.get_clients().values()
            for client, notice in itertools.product(clients, source.notices):
                client.add_notification("Hopping leg", notice, auto_close_seconds=_NOTICE_SECONDS)
            source.notices.clear()
        self._frames += 1

    def stop(self) -> None:
        """End ``run`` after the present picture; any thread may."""
        self._stopped = True

    def close(self) -> None:
        """Serve no more."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _text(self) -> str:
        """Return what the page says: one line per leg, and the time."""
        source, lines = self._source, []
        if isinstance(source, live_leg.LiveSimulation):
            lines += [f'Commanded: <b><span id="command">{source.height:.3f}</span> m</b>']
        for track, colour in zip(source.tracks, scene.track_colours(source.tracks), strict=True):
            height, name = track.last_apex(source.now), html.escape(track.name)
            apex = "none yet" if math.isnan(height) else f"{height:.3f} m"
            lines += [
                f'<b style="color:{colour}">{name}</b>: last apex <span class="apex">{apex}</span>'
            ]
            lines += [html.escape(track.note)] if track.note else []
        lines += [f'<span style="color:#77767b">{source.now:.2f} s</span>']
        return f'<div style="padding:0.4em 1em;line-height:1.5">{"<br>".join(lines)}</div>'


def answer(
    serve_page: Callable[[Any, Request], Response | None], connection: object, request: Request
) -> Response | None:
    """Return the answer to a request, None where the websocket may be opened."""
    if _is_own(request):
        response = serve_page(connection, request)
    else:
        said = b"This page is served to this computer alone, and to no other page."
        length = Headers({"Content-Type": "text/plain", "Content-Length": str(len(said))})
        response = Response(http.HTTPStatus.FORBIDDEN, "Forbidden", length, said)
    if response is not None:
        response.headers["X-Frame-Options"] = "DENY"
    return response


def _is_own(request: Request) -> bool:
    """Tell whether this computer's browser asks, for a page of our own."""
    host, origin = (request.headers.get(name, "") for name in ("Host", "Origin"))
    try:
        same = urlsplit(origin).netloc == host or not (origin or "Upgrade" in request.headers)
        return same and urlsplit(f"//{host}").hostname in _OWN
    except ValueError:  # none of a browser's
        return False


@contextlib.contextmanager
def _guarded() -> Iterator[None]:
    """Let every server of websockets that is made meanwhile ask here; there must be one."""
    from websockets.asyncio import server

    serve, made = server.serve, list[bool]()

    def asking(*args: Any, process_request: Any, **options: Any) -> Any:  # noqa: ANN401
        made.append(True)
        process = functools.partial(answer, process_request)
        return serve(*args, process_request=process, **options)

    with patch.object(server, "serve", asking):
        yield
    assert made, "this version of viser would serve everyone"
