"""Speed of the viewer: pictures per second, real time, from the slider to the command.

A real server and a real Chromium without a screen, which draws in software where there is no GPU:
what is measured is the whole way, on all of this computer's cores together.
"""

import functools
import io
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from PIL import Image
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically
from hopping_leg.robot import DEFAULT_ROBOT
from hopping_leg.terminal import plain_console
from hopping_leg.viewer.live_leg import LiveSimulation
from hopping_leg.viewer.viewer import FRAME_RATE, Viewer
from studies.shared import host
from studies.speed.browser import (
    SIZE,
    SMALL_SIZE,
    chromium,
    new_page,
    running,
    wait_for_leg,
)

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_SETTLE_SECONDS = 3.0
_PATIENCE = 60.0
_COLOURS = 128
_HEIGHT = re.compile(r"\d m")

_COUNT = """() => {
  if (window.drawn) return;
  window.drawn = [];
  const draw = (at) => { window.drawn.push(at); requestAnimationFrame(draw); };
  requestAnimationFrame(draw);
}"""
"""Notes when the browser draws; asked again, it goes on."""

_CANVAS = """() => {
  const canvas = document.querySelector("canvas[data-engine]");
  const gl = canvas.getContext("webgl2");
  const about = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "unknown";
  return JSON.stringify([[canvas.width, canvas.height], name]);
}"""
"""Size of the picture, pixels, and what draws it."""

_NOTE_KEY = """() => addEventListener("keydown", () => {
  window.pressed = performance.timeOrigin + performance.now();
}, true)"""
"""Notes, in the clock of the computer, when a key arrives at the page."""


@dataclass(frozen=True)
class View:
    """Drive the viewer's page in a Chromium without a screen; needs extra `view`, playwright."""

    controllers: Annotated[tuple[str, ...], tyro.conf.Positional] = ("fast",)
    """One, or two side by side: names, .onnx or gain files."""
    robot: str = DEFAULT_ROBOT
    """A shipped name or the path of a .toml file."""
    seconds: float = 20.0
    """Of watching."""
    commands: int = 40
    """Changes of the height by the slider."""
    picture: Path | None = None
    """Write a picture of the page to this file (.png)."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, commands=self.commands)
        if not 1 <= self.seconds <= 600:
            raise UsageError(f"--seconds is {self.seconds:g} but must lie between 1 and 600.")
        console = plain_console()
        result = bench_view(self, lambda words: console.print(f"{words} ..."))
        table = Table("measured", "value")
        for watched in (result, result["small_window"]):
            width, height = watched["window"]
            table.add_row(
                f"frames per second, window of {width} x {height}",
                f"{watched['frames_per_s']:.1f}",
            )
        table.add_row("poses sent per second", f"{result['pictures_sent_per_s']:.1f}")
        table.add_row("simulated over real time", f"{result['real_time']:.3f}")
        latency = result["latency_ms"]
        table.add_row("slider to command, median, ms", f"{latency['median']:.0f}")
        table.add_row("slider to command, longest, ms", f"{latency['most']:.0f}")
        table.add_row("from the command to the first hop, s", f"{result['start_s']:.1f}")
        console.print(table)
        return result


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


def bench_view(benchmark: View, tell: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Measure everything.

    Args:
        benchmark: What, and how long.
        tell: Called with what is done next.

    Raises:
        UsageError: There is no Chromium, or its page did not answer in time.
    """
    with chromium() as browser:
        tell("starting `hop view` as a user does")
        start = _start_seconds(browser, benchmark)
        live = _Noting(benchmark.controllers, benchmark.robot, 0.30)
        viewer = Viewer(live, benchmark.robot, port=0)
        with running(viewer):
            page = new_page(browser)
            received: list[float] = []
            page.on("websocket", lambda s: s.on("framereceived", lambda _: received.append(1.0)))
            wait_for_leg(page, viewer)
            tell(f"watching for {benchmark.seconds:g} s")
            measure = functools.partial(_watch, page, viewer, live, received, benchmark.seconds)
            watched = measure(SIZE)
            tell(f"watching a smaller window for {benchmark.seconds:g} s")
            small = measure(SMALL_SIZE)
            _resize(page, SIZE)
            if benchmark.picture is not None:
                _picture(page, benchmark.picture)
            tell(f"moving the slider {benchmark.commands} times")
            latency = _latencies(page, live, benchmark.commands)
        name = f"{browser.browser_type.name} {browser.version}"
    return {
        "start_s": start,
        **watched,
        "small_window": small,
        "latency_ms": {
            "median": float(np.median(latency)),
            "p95": float(np.percentile(latency, 95)),
            "most": float(latency.max()),
        },
        "setup": {
            "controllers": list(benchmark.controllers),
            "robot": benchmark.robot,
            "seconds": benchmark.seconds,
            "commands": benchmark.commands,
            "intended_pictures_per_s": FRAME_RATE,
            "browser": name,
            "viser": version("viser"),
        },
        "host": host(),
    }


def _start_seconds(browser: "Browser", benchmark: View) -> float:
    """Return the time from the command to the first finished hop on the page, s."""
    command = [sys.executable, "-m", "hopping_leg.cli", "view", *benchmark.controllers]
    command += ["--robot", benchmark.robot, "--port", "0", "--no-browser"]
    begun = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = next(word for word in process.stdout.readline().split() if "://" in word)
            page = new_page(browser)
            page.goto(address)
            page.locator(".apex").filter(has_text=_HEIGHT).first.wait_for()
            taken = time.monotonic() - begun
            page.close()
            return taken
        finally:
            process.terminate()


def _resize(page: "Page", window: tuple[int, int]) -> None:
    page.set_viewport_size({"width": window[0], "height": window[1]})
    time.sleep(_SETTLE_SECONDS)


def _watch(
    page: "Page",
    viewer: Viewer,
    live: LiveSimulation,
    received: list[float],
    seconds: float,
    window: tuple[int, int],
) -> dict[str, Any]:
    """Return what passes in a window of a size, pixels, while nobody interferes."""
    _resize(page, window)
    page.evaluate(_COUNT)
    page.wait_for_timeout(100)
    first = (time.monotonic(), live.now, viewer.frames, len(received))
    page.evaluate("window.drawn.length = 0")
    page.wait_for_timeout(1e3 * seconds)
    drawn = np.array(json.loads(page.evaluate("JSON.stringify(window.drawn)")))
    last = (time.monotonic(), live.now, viewer.frames, len(received))
    size, renderer = json.loads(page.evaluate(_CANVAS))
    wall, shown, pictures, messages = np.subtract(last, first)
    return {
        "window": list(window),
        "canvas": size,
        "renderer": renderer,
        "frames_per_s": float((len(drawn) - 1) / (1e-3 * (drawn[-1] - drawn[0]))),
        "longest_frame_ms": float(np.diff(drawn).max()),
        "pictures_sent_per_s": float(pictures / wall),
        "messages_received_per_s": float(messages / wall),
        "real_time": float(shown / wall),
    }


def _picture(page: "Page", path: Path) -> None:
    """Leave a picture of the page without its notices, in few colours, which makes it small."""
    for close in page.locator(".mantine-Notification-closeButton").all():
        close.click()
    page.evaluate("window.__viserTestpoints.devSettings.set({ fixedDpr: 1 })")
    page.wait_for_timeout(1000)
    picture, small = Image.open(io.BytesIO(page.screenshot())), io.BytesIO()
    picture.convert("RGB").quantize(_COLOURS).save(small, "PNG", optimize=True)
    write_atomically(path, small.getvalue())


def _latencies(page: "Page", live: _Noting, count: int) -> Array:
    """Return times from a key on the slider to the first tick with the new height, ms, (count,)."""
    page.evaluate(_NOTE_KEY)
    page.get_by_role("slider").first.focus()
    taken = np.empty(count)
    for number in range(count):
        before = live.reached
        page.keyboard.press("ArrowRight" if number % 2 else "ArrowLeft")
        end = time.monotonic() + _PATIENCE
        while live.reached is before:
            if time.monotonic() > end:
                raise UsageError(f"The slider's change {number + 1} never reached the leg.")
            page.wait_for_timeout(5)
        taken[number] = 1e3 * live.reached[1] - page.evaluate("window.pressed")
        page.wait_for_timeout(150)
    return taken
