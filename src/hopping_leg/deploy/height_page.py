"""A page in the browser with a slider for the height and a button that stops the leg."""

import contextlib
import json
import math
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from hopping_leg.deploy.keyboard import LiveHeight
from hopping_leg.errors import UsageError

_HOST = "127.0.0.1"
_NAMES = (_HOST, "localhost")
_LONGEST = 1000  # Bytes that a request's body may have
_PATIENCE = 5.0  # s
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Hopping leg</title>
<link rel="icon" href="data:,">
<style>
body { font: 1.2rem system-ui; max-width: 30rem; margin: 3rem auto; padding: 0 1rem }
input, button { width: 100%; margin: 1rem 0; font: inherit }
button { padding: 1rem; background: #b00020; color: white; border: 0; border-radius: .4rem }
</style>
<h1>Height <output id="shown"></output> m</h1>
<input id="height" type="range" step="0.01" aria-label="height in m">
<button id="stop">Stop the leg</button>
<p id="told" role="status"></p>
<script>
const slider = document.getElementById("height"), shown = document.getElementById("shown");
const told = document.getElementById("told");
async function send(path, body) {
  try {
    const reply = await fetch(path, body && { method: "POST", body: JSON.stringify(body) });
    const state = await reply.json();
    [slider.min, slider.max] = [state.low, state.high];
    slider.value = state.height;
    shown.value = state.height.toFixed(2);
    told.textContent = state.stopping ? "Stopping." : "";
  } catch { told.textContent = "The run is over."; }
}
slider.oninput = () => send("/height", { height: Number(slider.value) });
document.getElementById("stop").onclick = () => send("/stop", {});
send("/height");
setInterval(() => { if (document.activeElement !== slider) send("/height"); }, 1000);
</script></html>
"""


class _QuietServer(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Say nothing, e.g. of a browser that went away: the terminal belongs to the operator."""


class HeightPage:
    """Serves the page on this computer alone; port 0 takes a free one.

    Raises:
        UsageError: The port cannot be had.
    """

    def __init__(self, height: LiveHeight, port: int) -> None:
        self._height, self._stopping = height, False
        self._stop: Callable[[], None] | None = None
        try:
            self._server = _QuietServer((_HOST, port), self._handler())
        except (OSError, OverflowError) as error:
            raise UsageError(
                f"The page cannot be served at port {port} ({error}); give a free one, or 0."
            ) from error
        self._server.daemon_threads = True
        self.address = f"http://{_HOST}:{self._server.server_port}"

    @contextlib.contextmanager
    def serve(self, stop: Callable[[], None]) -> Iterator[None]:
        """Answer in a thread while the leg runs; ``stop`` stops it."""
        self._stop = stop
        thread = threading.Thread(target=self._server.serve_forever, name="page", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._server.shutdown()
            thread.join()
            self.close()

    def close(self) -> None:
        """Give the port back."""
        self._server.server_close()

    def _act(self, path: str, asked: object) -> bool:
        """Do what a request asks for; return whether it could. A stop stops, whatever it says."""
        if path == "/stop" and self._stop is not None:
            self._stopping = True
            self._stop()
            return True
        wanted = asked.get("height") if isinstance(asked, dict) else None
        if path != "/height" or isinstance(wanted, bool) or not isinstance(wanted, int | float):
            return False
        try:
            height = float(wanted)
        except OverflowError:
            return False
        if finite := math.isfinite(height):
            self._height.set(height)
        return finite

    def _state(self) -> bytes:
        low, high = self._height.valid
        state = {"height": self._height.at(0.0), "low": low, "high": high}
        return json.dumps({**state, "stopping": self._stopping}).encode()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        page = self

        class Handler(BaseHTTPRequestHandler):
            timeout = _PATIENCE

            def do_GET(self) -> None:
                if not self._own():
                    self._answer(403, b"", "text/plain")
                elif self.path == "/":
                    self._answer(200, _PAGE.encode(), "text/html; charset=utf-8")
                elif self.path == "/height":
                    self._answer(200, page._state(), "application/json")
                else:
                    self._answer(404, b"", "text/plain")

            def do_POST(self) -> None:
                if not self._own():
                    self._answer(403, b"", "text/plain")
                    return
                asked: object = None
                # What is no number, not JSON, too long or nested too deeply changes nothing.
                with contextlib.suppress(ValueError, RecursionError, TimeoutError):
                    length = int(self.headers.get("Content-Length", "0"))
                    if 0 <= length <= _LONGEST:
                        asked = json.loads(self.rfile.read(length) or b"{}")
                done = page._act(self.path, asked)
                self._answer(200 if done else 400, page._state(), "application/json")

            def _own(self) -> bool:
                """Tell whether it is the page that asks, not another site that names this one."""
                host = self.headers.get("Host")
                known = host in [f"{name}:{page._server.server_port}" for name in _NAMES]
                return known and self.headers.get("Origin", f"http://{host}") == f"http://{host}"

            def _answer(self, status: int, content: bytes, kind: str) -> None:
                self.send_response(status)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.send_header("X-Frame-Options", "DENY")
                self.send_header("Content-Security-Policy", "frame-ancestors 'none'")
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_: object) -> None:
                """Say nothing: the terminal belongs to the operator."""

        return Handler
