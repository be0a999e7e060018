"""The scene: legs as shapes, side by side, the commanded height, the last apex of each."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
import viser

from hopping_leg.arrays import Array
from hopping_leg.colours import COLOURS, COMMAND, controller_colours, rgb
from hopping_leg.robot import Robot, build_model
from hopping_leg.viewer.tracks import Track

Colour = tuple[int, int, int]

_APART = 0.36  # between legs, m
_AWAY = 1.2  # of the camera from a single leg, m
_FIELD_OF_VIEW = math.radians(32)
_FLOOR = (1.2, 0.5)  # half its size, m
_RULER: Colour = (90, 96, 104)
_AXLE: Colour = (235, 238, 242)

PLAIN: Any = {"material": "toon3", "cast_shadow": False, "receive_shadow": False}
"""Of every shape: the shading that costs least where a browser draws in software."""

_HOUSINGS = ("base", "knee_cap")
"""Spheres of the contact model that stand for motors; drawn as cylinders of the same outline."""

_ACROSS = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
"""Turns a cylinder's axis from z to y, that of the joints."""


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

    def pose(self, height: float, q: Array) -> None:
        """Move the leg: base height, m, and joint angles, rad, (2,)."""
        self.base.position = (0.0, 0.0, height)
        self.thigh.wxyz = _turned(q[0])
        self.shank.wxyz = _turned(q[1])


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
        scene.add_box(f"{name}/ruler/{tick}", _RULER, size, position=place, **PLAIN)
    command, apex = (
        scene.add_box(f"{name}/{mark}", its, (0.26, 0.002, thick), visible=False, **PLAIN)
        for mark, its, thick in (("command", rgb(COMMAND), 0.003), ("apex", colour, 0.002))
    )
    return _Leg(root, command, apex, *frames)


def _add_shape(
    scene: viser.SceneApi, path: str, model: mujoco.MjModel, geom: int, colour: Colour
) -> None:
    name, kind, size = model.geom(geom).name, model.geom_type[geom], model.geom_size[geom]
    red, green, blue = (int(255 * value) for value in model.mat_rgba[model.geom_matid[geom]][:3])
    own = (red, green, blue)
    place: Any = {"position": tuple(model.geom_pos[geom]), **PLAIN}
    turned = tuple(model.geom_quat[geom])
    if name in _HOUSINGS:
        width = 1.1 * size[0] if name == "base" else 1.8 * size[0]
        scene.add_cylinder(path, size[0], width, colour, wxyz=_ACROSS, **place)
        axle = 0.35 * size[0], width + 0.008, _AXLE
        scene.add_cylinder(f"{path}_axle", *axle, wxyz=_ACROSS, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        scene.add_icosphere(path, size[0], own, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        scene.add_box(path, own, tuple(2 * size), wxyz=turned, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        scene.add_cylinder(path, size[0], 2 * size[1], own, wxyz=turned, **place)


def _turned(angle: float) -> Array:
    """Return the rotation by a joint angle about the joints' axis, which is -y."""
    return np.array([math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0])


class Scene:
    """Draws tracks; call ``show`` for every picture."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._legs: list[_Leg] = []
        self._tracks: list[Track] = []
        _light(server.scene)
        _add_floor(server.scene)

    def show(self, tracks: list[Track], now: float) -> None:
        """Draw the legs as they are at a time, s; other legs than before are put up first."""
        if tracks is not self._tracks:
            self._build(tracks)
        with self._server.atomic():
            for leg, track in zip(self._legs, tracks, strict=True):
                if len(track):
                    leg.pose(*track.moment(now))

    def mark(self, now: float) -> None:
        """Move the marks of command and last apex; may be called less often than ``show``."""
        for leg, track in zip(self._legs, self._tracks, strict=True):
            _put(leg.command, track.latest("command_m", now))
            _put(leg.apex, track.last_apex(now))

    def _build(self, tracks: list[Track]) -> None:
        """Put up the legs; turn all cameras, also those of pages that are open, to them."""
        for leg in self._legs:
            leg.root.remove()
        self._tracks = tracks
        shown = zip(tracks, track_colours(tracks), strict=True)
        self._legs = [
            _add_leg(self._server.scene, number, track.robot, rgb(colour))
            for number, (track, colour) in enumerate(shown)
        ]
        middle = _APART * (len(tracks) - 1) / 2
        look_at, position = (middle, 0.0, 0.25), (middle + 0.12, -_AWAY - 3 * middle, 0.38)
        self._server.initial_camera.fov = _FIELD_OF_VIEW
        cameras: list[Any] = [c.camera for c in self._server.get_clients().values()]
        for camera in (self._server.initial_camera, *cameras):
            camera.position, camera.look_at = position, look_at


def _put(bar: viser.BoxHandle, height: float) -> None:
    """Move a mark, if it has anywhere to be; what does not change is not sent."""
    known = bool(np.isfinite(height))
    if known and abs(bar.position[2] - height) > 1e-6:
        bar.position = (0.03, 0.07, height)
    if bar.visible != known:
        bar.visible = known


def _light(scene: viser.SceneApi) -> None:
    """Light the scene cheaply: shadows and reflections cost most where there is no GPU."""
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/light/all", intensity=1.6)
    scene.add_light_directional("/light/sun", intensity=2.6, position=(-0.5, -1.2, 1.6))


def _add_floor(scene: viser.SceneApi) -> None:
    """Lay out a floor with lines every 0.1 m."""
    (x, y), thick = _FLOOR, 0.02
    scene.add_box(
        "/floor/slab",
        (226, 230, 235),
        (2 * x, 2 * y, thick),
        position=(0.0, 0.0, -thick / 2),
        **PLAIN,
    )
    lines = [((at, -y, 0.0), (at, y, 0.0)) for at in np.arange(-x, x + 0.05, 0.1)]
    lines += [((-x, at, 0.0), (x, at, 0.0)) for at in np.arange(-y, y + 0.05, 0.1)]
    scene.add_line_segments(
        "/floor/lines",
        np.array(lines) + np.array([0.0, 0.0, 0.0005]),
        (196, 202, 210),
        thickness=1.0,
        thickness_units="screen",
    )
