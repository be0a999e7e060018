"""Speed of the viewer: pictures per second, real time, from the slider to the command.

A real server and a real Chromium without a screen, which draws in software where there is no GPU:
what is measured is the whole way, on all of this computer's cores together.
"""

import io
import json
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from PIL import Image

from hopping_leg.cli.options import JsonFile, at_least
from hopping_leg.io import write_atomically
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.viewer.live_leg import LiveSimulation
from hopping_leg.viewer.viewer import Viewer
from studies.shared import Row, host, show_numbers
from studies.speed.browser import SIZE, chromium, new_page, running, wait_for_leg

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_SMALL_SIZE = (900, 600)
"""Of a window in which a software renderer has few pixels to draw."""

_HEIGHT = re.compile(r"\d m")

_COUNT = """() => {
  window.drawn = [];
  const draw = (at) => { window.drawn.push(at); requestAnimationFrame(draw); };
  requestAnimationFrame(draw);
}"""
"""Notes when the browser draws."""

_NOTE_KEY = """() => addEventListener("keydown", () => {
  window.pressed = performance.timeOrigin + performance.now();
}, true)"""
"""Notes, in the clock of the computer, when a key arrives at the page."""


@dataclass(frozen=True)
class View:
    """Drive the viewer's page in a Chromium without a screen; needs extra `view`, playwright."""

    controllers: Annotated[tuple[str, ...], tyro.conf.Positional] = ("fast",)
    """One, or two side by side: names, .onnx or gain files."""
    seconds: float = 20.0
    """Of watching."""
    commands: int = 40
    """Changes of the height by the slider."""
    picture: Path | None = None
    """Write a picture of the page to this file (.png)."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print and return every number."""
        at_least(1, commands=self.commands)
        with chromium() as browser:
            start = self._start_seconds(browser)
            live = _Noting(self.controllers, DEFAULT_ROBOT, 0.30)
            viewer = Viewer(live, port=0)
            with running(viewer):
                page = new_page(browser)
                wait_for_leg(page, viewer)
                page.evaluate(_COUNT)
                watched = self._watch(page, live, SIZE)
                small = self._watch(page, live, _SMALL_SIZE)
                _resize(page, SIZE)
                if self.picture is not None:
                    _save_picture(page, self.picture)
                latency = [_latency(page, live, number) for number in range(self.commands)]
            name = f"{browser.browser_type.name} {browser.version}"
        result = {
            "start_s": start,
            **watched,
            "small_window": small,
            "latency_ms": {"median": float(np.median(latency)), "most": max(latency)},
            "setup": {
                "controllers": list(self.controllers),
                "seconds": self.seconds,
                "commands": self.commands,
                "browser": name,
            },
            "host": host(),
        }
        show_numbers("Viewer", result)
        return result

    def _start_seconds(self, browser: "Browser") -> float:
        """Return the time from the command to the first finished hop on the page, s."""
        command = [sys.executable, "-m", "hopping_leg.cli", "view", *self.controllers]
        command += ["--port", "0", "--no-browser"]
        begun = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                words = process.stdout.readline().split()
                page = new_page(browser)
                page.goto(next(word for word in words if "://" in word))
                page.locator(".apex").filter(has_text=_HEIGHT).first.wait_for()
                taken = time.monotonic() - begun
                page.close()
                return taken
            finally:
                process.terminate()

    def _watch(self, page: "Page", live: LiveSimulation, window: tuple[int, int]) -> Row:
        """Return what passes in a window of a size, pixels, while nobody interferes."""
        _resize(page, window)
        first = (time.monotonic(), live.now)
        page.evaluate("window.drawn.length = 0")
        page.wait_for_timeout(1e3 * self.seconds)
        drawn = json.loads(page.evaluate("JSON.stringify(window.drawn)"))
        wall, shown = np.subtract((time.monotonic(), live.now), first)
        return {
            "window": list(window),
            "frames_per_s": 1e3 * (len(drawn) - 1) / (drawn[-1] - drawn[0]),
            "real_time": float(shown / wall),
        }


class _Noting(LiveSimulation):
    """A simulation that notes when a new height first reached the controllers."""

    def __init__(self, controllers: tuple[str, ...], robot: str, height: float) -> None:
        super().__init__(controllers, robot, height)
        self.reached: tuple[float, float] = (self.height, time.time())

    def tick(self) -> None:
        """Let one control period pass."""
        super().tick()
        if self.height != self.reached[0]:
            self.reached = (self.height, time.time())


def _resize(page: "Page", window: tuple[int, int]) -> None:
    page.set_viewport_size({"width": window[0], "height": window[1]})
    page.wait_for_timeout(3000)


def _save_picture(page: "Page", path: Path) -> None:
    """Leave a picture of the page without its notices, in few colours, which makes it small."""
    for close in page.locator(".mantine-Notification-closeButton").all():
        close.click()
    page.evaluate("window.__viserTestpoints.devSettings.set({ fixedDpr: 1 })")
    page.wait_for_timeout(1000)
    picture, small = Image.open(io.BytesIO(page.screenshot())), io.BytesIO()
    picture.convert("RGB").quantize(128).save(small, "PNG", optimize=True)
    write_atomically(path, small.getvalue())


def _latency(page: "Page", live: _Noting, number: int) -> float:
    """Return the time from a key on the slider to the first tick with the new height, ms."""
    page.evaluate(_NOTE_KEY)
    page.get_by_role("slider").first.focus()
    before = live.reached
    page.keyboard.press("ArrowRight" if number % 2 else "ArrowLeft")
    while live.reached is before:
        page.wait_for_timeout(5)
    page.wait_for_timeout(150)
    return float(1e3 * live.reached[1] - page.evaluate("window.pressed"))
