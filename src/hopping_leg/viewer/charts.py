"""Curves of the last seconds: base height, torques with their limits, phase."""

from typing import Any

import numpy as np
import viser

from hopping_leg.arrays import Array
from hopping_leg.colours import COMMAND
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.viewer.scene import track_colours
from hopping_leg.viewer.tracks import Track, in_flight

SECONDS = 5.0
"""Shown."""

_GRID = np.linspace(-SECONDS, 0.0, 400)
_LIMIT = "#9a9996"
_AXIS = "#59636e"
_PHASES = ("stance", "flight", "landing")


class Charts:
    """Four plots in a panel of their own."""

    def __init__(self, server: viser.ViserServer, panel: Any) -> None:  # noqa: ANN401
        self._gui: Any = server.gui
        self._panel = panel
        self._tracks: list[Track] = []
        self._plots: list[Any] = []
        self._curves: list[tuple[Array, ...]] = []

    def show(self, tracks: list[Track], now: float, turn: int) -> None:
        """Draw the seconds before ``now``, s; other legs than before get curves of their own.

        A turn changes the plot of its number alone, as a browser without a GPU else misses a
        frame; the first takes the data for all.
        """
        if turn == 0 or tracks is not self._tracks:
            self._curves = _curves(tracks, now + _GRID)
        if tracks is not self._tracks:
            self._tracks = tracks
            self._build()
        elif turn < len(self._plots):
            self._plots[turn].data = self._curves[turn]

    def _build(self) -> None:
        for plot in self._plots:
            plot.remove()
        self._plots = []
        for data, (title, series, scale, axis, height) in zip(
            self._curves, _layouts(self._tracks), strict=True
        ):
            with self._panel:
                plot = self._gui.add_uplot(
                    data,
                    series,
                    title=title,
                    scales={"x": {"time": False}, "y": scale},
                    axes=(_axis(28), _axis(62) | axis),
                    legend={"show": False},
                    height=height,
                    padding=(4, 10, 0, 0),
                )
            self._plots.append(plot)


def _curves(tracks: list[Track], time: Array) -> list[tuple[Array, ...]]:
    """Return what each plot shows over the time, s, in the order of ``_layouts``."""
    if not tracks:
        return []
    shown = [track.sample(time) for track in tracks]
    heights = (time, shown[0]["command_m"], *(s["height_m"] for s in shown))
    torques = []
    for joint in JOINTS:
        limit = np.full(len(time), getattr(tracks[0].robot, joint).torque_limit)
        torques.append((time, limit, -limit, *(s[f"{joint}_torque_nm"] for s in shown)))
    phases = *(in_flight(s["foot_clearance_m"]) for s in shown), *(s["phase"] for s in shown)
    return [heights, *torques, (time, *phases)]


def _layouts(tracks: list[Track]) -> list[tuple[Any, ...]]:
    """Return title, series, vertical scale, vertical axis and height in pixels of each plot."""
    if not tracks:
        return []
    named = [
        (track.name, colour) for track, colour in zip(tracks, track_colours(tracks), strict=True)
    ]
    lines = [_line(name, colour) for name, colour in named]
    steps = [_line(f"{name}, in the air", colour, 2) for name, colour in named]
    own = [_line(f"{name}, its phase", colour, 1, dash=(2, 2)) for name, colour in named]
    command = _line("command", COMMAND, 2, dash=(6, 4))
    bounds = [_line(f"{side} limit", _LIMIT, 1, dash=(4, 4)) for side in ("upper", "lower")]
    tall = 1.5 * tracks[0].robot.straight_height
    found: list[tuple[Any, ...]] = []
    title = "Height / m over time / s"
    found.append((title, ({}, command, *lines), {"range": (0.0, tall)}, {}, 170))
    for joint in JOINTS:
        limit = 1.15 * getattr(tracks[0].robot, joint).torque_limit
        title = f"{joint.capitalize()} torque / N m"
        found.append((title, ({}, *bounds, *lines), {"range": (-limit, limit)}, {}, 130))
    title = "Phase: foot (solid), the controller's own (dashed)"
    axis = {"splits": list(range(len(_PHASES))), "values": list(_PHASES)}
    found.append((title, ({}, *steps, *own), {"range": (-0.2, 2.2)}, axis, 120))
    return found


def _line(label: str, colour: str, width: float = 1.5, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    return {"label": label, "stroke": colour, "width": width, "points": {"show": False}, **more}


def _axis(size: int) -> dict[str, Any]:
    return {
        "size": size,
        "stroke": _AXIS,
        "font": "12px system-ui, sans-serif",
        "grid": {"width": 1},
        "ticks": {"width": 1, "size": 5},
    }
