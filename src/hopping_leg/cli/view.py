"""Watch the leg hop in the browser, and interfere.

Without further words a live simulation: change height, controller, robot, payload, ground and
delay while it hops, push it, pause, step, go slow; a second controller hops beside the first. With
--trace it replays traces, simulated or from hardware. It needs no screen on this computer: on
another one, open the printed address through `ssh -L 8080:localhost:8080`. `hop demo` is the same
verb.

Examples:
  hop view
  hop view fast energy-shaping --height 0.32
  hop view runs/mine/policy.onnx --robot examples/my_leg.toml
  hop view --trace runs/deploy/fast-20260101-120000.parquet
"""

import os
import sys
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from hopping_leg.cli import DEMO
from hopping_leg.cli.options import say

if TYPE_CHECKING:
    from hopping_leg.viewer.viewer import Source


@dataclass(frozen=True)
class View:
    """What is shown, and where the page is."""

    controllers: Annotated[tuple[str, ...], tyro.conf.Positional] = DEMO
    """One controller, or two side by side: shipped names, .onnx files or gain files."""
    robot: str | None = None
    """A shipped robot or a .toml file; default: the one that the first policy was trained on, or
    that a trace names."""
    height: float = 0.30
    """Desired height at the start, m."""
    seed: int = 0
    """Seed of noise and random delay."""
    trace: tuple[Path, ...] = ()
    """Traces to replay, one or two side by side; also the .blackbox that a killed run left."""
    port: int = 8080
    """Port of this computer alone; if it is in use, the next free one."""
    browser: bool = True
    """Open the page where there is a screen; --no-browser: only print its address."""
    seconds: float = float("inf")
    """Time after which the viewer stops, s."""


def run(args: View) -> None:
    """Serve the page until Ctrl-C."""
    source = _source(args)
    from hopping_leg.viewer.viewer import Viewer

    viewer = Viewer(source, port=args.port)
    say(f"Open {viewer.address} in a browser; Ctrl-C stops.")
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if args.browser and (screen or sys.platform in ("win32", "darwin")):
        webbrowser.open(viewer.address)
    try:
        viewer.run(args.seconds)
    except KeyboardInterrupt:
        say("Stopped.")
    finally:
        viewer.close()


def _source(args: View) -> "Source":
    """Return what is to be shown; whatever can be wrong with it is found here."""
    from hopping_leg.controllers.registry import robot_of
    from hopping_leg.viewer.live_leg import LiveSimulation
    from hopping_leg.viewer.tracks import ReplaySource

    if args.trace:
        return ReplaySource(args.trace, args.robot)
    robot = args.robot or robot_of(args.controllers)
    return LiveSimulation(args.controllers, robot, args.height, args.seed)
