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
_AXIS = {
    "stroke": "#59636e",
    "font": "12px system-ui, sans-serif",
    "grid": {"width": 1},
    "ticks": {"width": 1, "size": 5},
}
_PHASES = ("stance", "flight", "landing")


class Charts:
    """Four plots in a panel of their own."""

    def __init__(self, server: viser.ViserServer, panel: Any) -> None:  # noqa: ANN401
        self._gui: Any = server.gui
        self._panel = panel
        self._tracks: list[Track] = []
        self._plots: list[Any] = []

    def show(self, tracks: list[Track], now: float, turn: int) -> None:
        """Draw the seconds before ``now``, s; other legs than before get curves of their own.

        A turn changes the plot of its number alone, as a browser without a GPU else misses a frame.
        """
        if tracks is not self._tracks:
            for plot in self._plots:
                plot.remove()
            with self._panel:
                self._plots = [self._gui.add_uplot(**p) for p in _plots(tracks, now + _GRID)]
            self._tracks = tracks
        elif turn < len(self._plots):
            self._plots[turn].data = _plots(tracks, now + _GRID)[turn]["data"]


def _plots(tracks: list[Track], time: Array) -> list[dict[str, Any]]:
    """Return all that each plot of some legs over the time, s, consists of."""
    if not tracks:
        return []
    shown = [track.sample(time) for track in tracks]
    named = [(t.name, colour) for t, colour in zip(tracks, track_colours(tracks), strict=True)]
    lines = [_line(name, colour) for name, colour in named]

    def plot(
        title: str,
        curves: list[tuple[dict[str, Any], Array]],
        bounds: tuple[float, float],
        height: int,
        **axis: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        return {
            "data": (time, *(values for _, values in curves)),
            "series": ({}, *(line for line, _ in curves)),
            "title": title,
            "scales": {"x": {"time": False}, "y": {"range": bounds}},
            "axes": ({**_AXIS, "size": 28}, {**_AXIS, "size": 62, **axis}),
            "legend": {"show": False},
            "height": height,
            "padding": (4, 10, 0, 0),
        }

    def own(field: str) -> list[tuple[dict[str, Any], Array]]:
        return [(line, sample[field]) for line, sample in zip(lines, shown, strict=True)]

    command = _line("command", COMMAND, 2, dash=(6, 4)), shown[0]["command_m"]
    tall = 1.5 * tracks[0].robot.straight_height
    found = [plot("Height / m over time / s", [command, *own("height_m")], (0.0, tall), 170)]
    for joint in JOINTS:
        most = getattr(tracks[0].robot, joint).torque_limit
        limits = [
            (_line(f"{side} limit", _LIMIT, 1, dash=(4, 4)), np.full(len(time), sign * most))
            for side, sign in (("upper", 1), ("lower", -1))
        ]
        title, curves = f"{joint.capitalize()} torque / N m", limits + own(f"{joint}_torque_nm")
        found.append(plot(title, curves, (-1.15 * most, 1.15 * most), 130))
    phases = [
        (_line(f"{name}, in the air", colour, 2), in_flight(sample["foot_clearance_m"]))
        for (name, colour), sample in zip(named, shown, strict=True)
    ]
    phases += [
        (_line(f"{name}, its phase", colour, 1, dash=(2, 2)), sample["phase"])
        for (name, colour), sample in zip(named, shown, strict=True)
    ]
    title = "Phase: foot (solid), the controller's own (dashed)"
    ticks = {"splits": list(range(len(_PHASES))), "values": list(_PHASES)}
    return [*found, plot(title, phases, (-0.2, 2.2), 120, **ticks)]


def _line(label: str, colour: str, width: float = 1.5, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    return {"label": label, "stroke": colour, "width": width, "points": {"show": False}, **more}
