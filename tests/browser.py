"""A browser without a screen, driven from here: for the tests of pages."""

import contextlib
import functools
import http.server
import shutil
import threading

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-unsafe-swiftshader",
]  # fmt: skip
"""Draws in software, loads nothing that the page does not ask for."""

PATIENCE = 120_000.0
"""For whatever should happen, ms: drawn in software, it is slow on a busy computer."""


def find_chromium():
    """Return the path of a Chromium, None if there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def new_page(browser):
    """Open an empty page in a window of 1280 by 800 pixels."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(PATIENCE)
    return page


@contextlib.contextmanager
def running(viewer):
    """Let a viewer run in a thread of its own; it serves no more afterwards."""
    thread = threading.Thread(target=viewer.run, name="viewer", daemon=True)
    thread.start()
    try:
        yield
    finally:
        viewer.stop()
        thread.join()
        viewer.close()


@contextlib.contextmanager
def serving(folder):
    """Serve a folder's files on this computer; yield the address."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def wait_for_leg(page, viewer):
    """Open the viewer's page and wait until it is connected and shows what hops."""
    page.goto(viewer.address)
    page.get_by_text("last apex").first.wait_for()
    page.locator("canvas[data-engine]").wait_for()
