"""What is drawn of tracks: legs side by side with their marks, and curves of the last seconds."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
import viser

from hopping_leg.arrays import Array
from hopping_leg.figures import COLOURS, COMMAND, controller_colours, rgb
from hopping_leg.robot import JOINTS, Robot, build_model
from hopping_leg.viewer.tracks import Track

Colour = tuple[int, int, int]

_APART = 0.36  # between legs, m
_AWAY = 1.2  # of the camera from a single leg, m
_FIELD_OF_VIEW = math.radians(32)
_FLOOR = (1.2, 0.5)  # half its size, m
_RULER: Colour = (90, 96, 104)

_PLAIN: Any = {"material": "toon3", "cast_shadow": False, "receive_shadow": False}
"""Of every shape: the shading that costs least where a browser draws in software."""

SECONDS = 5.0  # Of the curves

_GRID = np.linspace(-SECONDS, 0.0, 400)
_LIMIT = "#9a9996"
_LINE = {"points": {"show": False}}
_AXIS = {
    "stroke": "#59636e",
    "font": "12px system-ui, sans-serif",
    "grid": {"width": 1},
    "ticks": {"width": 1, "size": 5},
}


def track_colours(tracks: Sequence[Track]) -> list[str]:
    """Return the colour of each leg and of its curves: its controller's, if they are different."""
    names = [track.name for track in tracks]
    own = controller_colours(names)
    return list(own.values()) if len(own) == len(names) else list(COLOURS[: len(names)])


class _Leg(NamedTuple):
    """Handles of what moves: the base slides, thigh and shank turn, two bars mark heights."""

    root: viser.FrameHandle
    command: viser.BoxHandle
    apex: viser.BoxHandle
    base: viser.FrameHandle
    thigh: viser.FrameHandle
    shank: viser.FrameHandle


def _add_leg(scene: viser.SceneApi, number: int, robot: Robot, colour: Colour) -> _Leg:
    """Put a leg into the scene, with its ruler and marks."""
    name, model = f"/legs/{number}", build_model(robot)
    root = scene.add_frame(name, show_axes=False, position=(_APART * number, 0.0, 0.0))
    paths, frames = {0: name}, []
    for body in range(1, model.nbody):
        paths[body] = f"{paths[int(model.body_parentid[body])]}/{model.body(body).name}"
        place = tuple(model.body_pos[body])
        frames.append(scene.add_frame(paths[body], show_axes=False, position=place))
    for geom in range(model.ngeom):
        path = f"{paths[int(model.geom_bodyid[geom])]}/{model.geom(geom).name}_shape"
        _add_shape(scene, path, model, geom, colour)
    for tenth in range(1, 6):
        scene.add_label(
            f"{name}/ruler/label{tenth}",
            f"{tenth / 10:g}",
            position=(-0.115, 0.027, tenth / 10),
            font_screen_scale=1.5,
            anchor="center-right",
        )
    for tick in range(1, 17):
        x, long = (-0.086, 0.016) if tick % 2 == 0 else (-0.082, 0.008)
        size, place = (long, 0.002, 0.0016), (x, 0.027, 0.05 * tick)
        scene.add_box(f"{name}/ruler/{tick}", _RULER, size, position=place, **_PLAIN)
    command, apex = (
        scene.add_box(f"{name}/{mark}", its, (0.26, 0.002, thick), visible=False, **_PLAIN)
        for mark, its, thick in (("command", rgb(COMMAND), 0.003), ("apex", colour, 0.002))
    )
    return _Leg(root, command, apex, *frames)


def _add_shape(
    scene: viser.SceneApi, path: str, model: mujoco.MjModel, geom: int, colour: Colour
) -> None:
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if model.geom(geom).name not in ("base", "knee_cap"):  # which stand for the motors
        red, green, blue = (int(255 * v) for v in model.mat_rgba[model.geom_matid[geom]][:3])
        colour = (red, green, blue)
    place: Any = {"position": tuple(model.geom_pos[geom]), **_PLAIN}
    turned = tuple(model.geom_quat[geom])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        scene.add_icosphere(path, size[0], colour, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        scene.add_box(path, colour, tuple(2 * size), wxyz=turned, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        scene.add_cylinder(path, size[0], 2 * size[1], colour, wxyz=turned, **place)


def _turned(angle: float) -> Array:
    """Return the rotation by a joint angle about the joints' axis, which is -y."""
    return np.array([math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0])


def _put(bar: viser.BoxHandle, height: float) -> None:
    """Move a mark, if it has anywhere to be; what does not change is not sent."""
    known = bool(np.isfinite(height))
    if known and abs(bar.position[2] - height) > 1e-6:
        bar.position = (0.03, 0.07, height)
    if bar.visible != known:
        bar.visible = known


class Scene:
    """Draws tracks, their curves in a panel of the page; call ``show`` for every picture."""

    def __init__(self, server: viser.ViserServer, panel: Any) -> None:  # noqa: ANN401
        self._server, self._panel = server, panel
        self._tracks: list[Track] = []
        self._legs: list[_Leg] = []
        self._plots: list[Any] = []
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)  # reflections and shadows cost most without a GPU
        scene.configure_default_lights(enabled=False)
        scene.add_light_ambient("/light/all", intensity=1.6)
        scene.add_light_directional("/light/sun", intensity=2.6, position=(-0.5, -1.2, 1.6))
        (x, y), thick = _FLOOR, 0.02
        slab, under = (2 * x, 2 * y, thick), (0.0, 0.0, -thick / 2)
        scene.add_box("/floor/slab", (226, 230, 235), slab, position=under, **_PLAIN)
        above = 0.0005  # the slab, m
        lines = [((at, -y, above), (at, y, above)) for at in np.arange(-x, x + 0.05, 0.1)]
        lines += [((-x, at, above), (x, at, above)) for at in np.arange(-y, y + 0.05, 0.1)]
        look: Any = {"thickness": 1.0, "thickness_units": "screen"}
        scene.add_line_segments("/floor/lines", np.array(lines), (196, 202, 210), **look)

    def show(self, tracks: list[Track], now: float, turn: int) -> None:
        """Draw the legs at a time, s, and what has its turn: one of three plots, or the marks.

        All of them at once would cost a browser without a GPU a picture.
        """
        if tracks is not self._tracks:
            self._build(tracks, now)
        with self._server.atomic():
            for leg, track in zip(self._legs, tracks, strict=True):
                if len(track):
                    height, (hip, knee) = track.moment(now)
                    leg.base.position = (0.0, 0.0, height)
                    leg.thigh.wxyz, leg.shank.wxyz = _turned(hip), _turned(knee)
        if turn < len(self._plots):
            self._plots[turn].data = _plots(tracks, now + _GRID)[turn]["data"]
        elif turn == len(self._plots):
            for leg, track in zip(self._legs, tracks, strict=True):
                _put(leg.command, track.latest("command_m", now))
                _put(leg.apex, track.last_apex(now))

    def _build(self, tracks: list[Track], now: float) -> None:
        """Put up other legs and plots; turn all cameras, also those of open pages, to the legs."""
        for gone in (*(leg.root for leg in self._legs), *self._plots):
            gone.remove()
        self._tracks, gui = tracks, self._server.gui
        shown = zip(tracks, track_colours(tracks), strict=True)
        self._legs = [
            _add_leg(self._server.scene, number, track.robot, rgb(colour))
            for number, (track, colour) in enumerate(shown)
        ]
        with self._panel:
            self._plots = [gui.add_uplot(**plot) for plot in _plots(tracks, now + _GRID)]
        middle = _APART * (len(tracks) - 1) / 2
        look_at, position = (middle, 0.0, 0.25), (middle + 0.12, -_AWAY - 3 * middle, 0.38)
        self._server.initial_camera.fov = _FIELD_OF_VIEW
        cameras: list[Any] = [c.camera for c in self._server.get_clients().values()]
        for camera in (self._server.initial_camera, *cameras):
            camera.position, camera.look_at = position, look_at


def _plots(tracks: list[Track], time: Array) -> list[dict[str, Any]]:
    """Return all that each plot of some legs over the time, s, consists of."""
    robot, samples = tracks[0].robot, [track.sample(time) for track in tracks]
    tall, command = 1.5 * robot.straight_height, (COMMAND, 2.0, samples[0]["command_m"])
    shown = [("Height / m over time / s", "height_m", (0.0, tall), [command])]
    for joint in JOINTS:
        most = getattr(robot, joint).torque_limit
        limits = [(_LIMIT, 1.0, np.full(len(time), side * most)) for side in (-1.0, 1.0)]
        bounds = (-1.15 * most, 1.15 * most)
        shown.append((f"{joint.capitalize()} torque / N m", f"{joint}_torque_nm", bounds, limits))
    colours = track_colours(tracks)
    return [
        {
            "data": (time, *(c[2] for c in dashed), *(sample[field] for sample in samples)),
            "series": (
                {},
                *({**_LINE, "stroke": c, "width": width, "dash": (5, 4)} for c, width, _ in dashed),
                *({**_LINE, "stroke": colour, "width": 1.5} for colour in colours),
            ),
            "title": title,
            "scales": {"x": {"time": False}, "y": {"range": bounds}},
            "axes": ({**_AXIS, "size": 28}, {**_AXIS, "size": 62}),
            "legend": {"show": False},
            "height": 170,
            "padding": (4, 10, 0, 0),
        }
        for title, field, bounds, dashed in shown
    ]
