"""Curves of the last seconds: base height, torques with their limits, phase."""

from typing import Any

import numpy as np
import viser

from hopping_leg.arrays import Array
from hopping_leg.robot.parameters import JOINTS
from hopping_leg.viewer.scene import COLOURS, COMMAND
from hopping_leg.viewer.tracks import Track, in_flight

SECONDS = 5.0
"""Shown."""

_POINTS = 400
_GRID = np.linspace(-SECONDS, 0.0, _POINTS)
_LIMIT = "#9a9996"
_AXIS = "#5e5c64"


class Charts:
    """Four plots in a panel of their own.

    Args:
        server: Of the page.
        panel: Where they stand.
    """

    def __init__(self, server: viser.ViserServer, panel: Any) -> None:  # noqa: ANN401
        self._server, self._panel = server, panel
        self._tracks: list[Track] = []
        self._plots: list[Any] = []
        self._curves: list[tuple[Array, ...]] = []

    def show(self, tracks: list[Track], now: float, turn: int) -> None:
        """Draw the seconds before ``now``, s; other legs than before get curves of their own.

        A browser without a GPU misses a frame if all plots change in one.

        Args:
            tracks: Of the legs.
            now: Time, s.
            turn: Number of the plot that is drawn; none if there are fewer. The first turn takes
                the data for all.
        """
        if turn == 0 or tracks is not self._tracks:
            self._curves = _curves(tracks, [track.sample(now + _GRID) for track in tracks])
        if tracks is not self._tracks:
            self._tracks = tracks
            self._build(tracks, self._curves)
        elif turn < len(self._plots):
            self._plots[turn].data = self._curves[turn]

    def _build(self, tracks: list[Track], curves: list[tuple[Array, ...]]) -> None:
        for plot in self._plots:
            plot.remove()
        self._plots = []
        axes: Any = (_axis(28), _axis(44))
        if not tracks:
            return
        with self._panel:
            for (title, series, scale, height), data in zip(_layouts(tracks), curves, strict=True):
                scales: Any = {"x": {"time": False, "range": (-SECONDS, 0.0)}, "y": scale}
                self._plots.append(
                    self._server.gui.add_uplot(
                        data,
                        series,
                        title=title,
                        scales=scales,
                        axes=axes,
                        legend={"show": False},
                        height=height,
                        padding=(4, 10, 0, 0),
                    )
                )


def _curves(tracks: list[Track], shown: list[dict[str, Array]]) -> list[tuple[Array, ...]]:
    """Return what each plot shows, in the order of ``_layouts``."""
    if not tracks:
        return []
    heights = (_GRID, shown[0]["command_m"], *(s["height_m"] for s in shown))
    torques = []
    for joint in JOINTS:
        limit = np.full(_POINTS, getattr(tracks[0].robot, joint).torque_limit)
        torques.append((_GRID, limit, -limit, *(s[f"{joint}_torque_nm"] for s in shown)))
    phases = [in_flight(s["foot_clearance_m"]) for s in shown]
    own = [s["phase"] for s in shown]
    return [heights, *torques, (_GRID, *phases, *own)]


def _layouts(tracks: list[Track]) -> list[tuple[str, tuple[Any, ...], dict[str, Any], int]]:
    """Return title, series, vertical scale and height in pixels of each plot."""
    names = [track.name for track in tracks]
    lines = [_line(name, _css(COLOURS[i])) for i, name in enumerate(names)]
    steps = [_line(f"{name}, in the air", _css(COLOURS[i]), 2) for i, name in enumerate(names)]
    own = [
        _line(f"{name}, its phase", _css(COLOURS[i]), 1, dash=(2, 2))
        for i, name in enumerate(names)
    ]
    command = _line("command", _css(COMMAND), 2, dash=(6, 4))
    bounds = [_line(f"{side} limit", _LIMIT, 1, dash=(4, 4)) for side in ("upper", "lower")]
    tall = 1.5 * tracks[0].robot.straight_height
    found = [("Base height, m", ({}, command, *lines), {"range": (0.0, tall)}, 160)]
    for joint in JOINTS:
        limit = 1.15 * getattr(tracks[0].robot, joint).torque_limit
        title = f"{joint.capitalize()} torque, N m"
        found.append((title, ({}, *bounds, *lines), {"range": (-limit, limit)}, 120))
    phase = "In the air (solid), the controller's phase (dashed)"
    found.append((phase, ({}, *steps, *own), {"range": (-0.2, 2.2)}, 100))
    return found


def _line(label: str, colour: str, width: float = 1.5, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    return {"label": label, "stroke": colour, "width": width, "points": {"show": False}, **more}


def _axis(size: int) -> dict[str, Any]:
    return {"size": size, "stroke": _AXIS, "font": "11px sans-serif", "grid": {"width": 0.5}}


def _css(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
