"""A browser without a screen, driven from here: for the tests of the page."""

import contextlib
import shutil
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

from hopping_leg.errors import UsageError
from hopping_leg.viewer.viewer import Viewer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
)
"""Draws in software, loads nothing that the page does not ask for."""

PATIENCE = 120_000.0
"""For whatever should happen, ms: drawn in software, it is slow on a busy computer."""

SIZE = (1280, 800)
"""Of the window, pixels."""


def find_chromium() -> str | None:
    """Return the path of a Chromium, None if there is none."""
    return next((path for name in _NAMES if (path := shutil.which(name))), None)


@contextlib.contextmanager
def running(viewer: Viewer) -> Iterator[None]:
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
def chromium() -> Iterator["Browser"]:
    """Start a browser with an empty profile.

    Raises:
        UsageError: There is no Chromium.
    """
    from playwright.sync_api import sync_playwright

    if (path := find_chromium()) is None:
        raise UsageError(
            f"There is no browser; install Chromium, known as one of: {', '.join(_NAMES)}."
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=list(_FLAGS), timeout=PATIENCE
        )
        try:
            yield browser
        finally:
            browser.close()


def new_page(browser: "Browser") -> "Page":
    """Open an empty page in a window of ``SIZE``."""
    page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
    page.set_default_timeout(PATIENCE)
    return page


def wait_for_leg(page: "Page", viewer: Viewer) -> None:
    """Open the viewer's page and wait until it is connected and shows what hops."""
    page.goto(viewer.address)
    page.get_by_text("last apex").first.wait_for()
    page.locator("canvas[data-engine]").wait_for()
