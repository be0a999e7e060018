"""A leg as shapes in the browser, made of the model that is simulated."""

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import viser

from hopping_leg.arrays import Array
from hopping_leg.robot import Robot, build_model

Colour = tuple[int, int, int]

PLAIN: Any = {"material": "toon3", "cast_shadow": False, "receive_shadow": False}
"""Of every shape: the shading that costs least where a browser draws in software."""

_HOUSINGS = ("base", "knee_cap")
"""Spheres of the contact model that stand for motors; drawn as cylinders of the same outline."""

_ACROSS = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
"""Turns a cylinder's axis from z to y, that of the joints."""


@dataclass(frozen=True)
class LegMesh:
    """Handles of one leg: the base slides, thigh and shank turn."""

    root: viser.FrameHandle
    base: viser.FrameHandle
    thigh: viser.FrameHandle
    shank: viser.FrameHandle

    def pose(self, height: float, q: Array) -> None:
        """Move the leg: base height, m, and joint angles, rad, (2,)."""
        self.base.position = (0.0, 0.0, height)
        self.thigh.wxyz = _turned(q[0])
        self.shank.wxyz = _turned(q[1])


def add_leg(
    server: viser.ViserServer, name: str, robot: Robot, x: float, colour: Colour
) -> LegMesh:
    """Put a leg into the scene at a path; its rail stands at ``x``, m."""
    model = build_model(robot)
    root = server.scene.add_frame(name, show_axes=False, position=(x, 0.0, 0.0))
    paths, frames = {0: name}, []
    for body in range(1, model.nbody):
        path = f"{paths[int(model.body_parentid[body])]}/{model.body(body).name}"
        frames.append(
            server.scene.add_frame(path, show_axes=False, position=tuple(model.body_pos[body]))
        )
        paths[body] = path
    for geom in range(model.ngeom):
        path = f"{paths[int(model.geom_bodyid[geom])]}/{model.geom(geom).name}_shape"
        _add_shape(server, path, model, geom, colour)
    return LegMesh(root, *frames)


def _add_shape(
    server: viser.ViserServer, path: str, model: mujoco.MjModel, geom: int, colour: Colour
) -> None:
    name, size = model.geom(geom).name, model.geom_size[geom]
    red, green, blue = (int(255 * value) for value in model.mat_rgba[model.geom_matid[geom]][:3])
    rgb = (red, green, blue)
    kind = model.geom_type[geom]
    scene = server.scene
    place: Any = {"position": tuple(model.geom_pos[geom]), **PLAIN}
    turned = tuple(model.geom_quat[geom])
    if name in _HOUSINGS:
        width = 1.1 * size[0] if name == "base" else 1.8 * size[0]
        scene.add_cylinder(path, size[0], width, colour, wxyz=_ACROSS, **place)
        axle = (235, 238, 242)
        path += "_axle"
        scene.add_cylinder(path, 0.35 * size[0], width + 0.008, axle, wxyz=_ACROSS, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        scene.add_icosphere(path, size[0], rgb, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        scene.add_box(path, rgb, tuple(2 * size), wxyz=turned, **place)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        scene.add_cylinder(path, size[0], 2 * size[1], rgb, wxyz=turned, **place)


def _turned(angle: float) -> Array:
    """Return the rotation by a joint angle about the joints' axis, which is -y."""
    return np.array([math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0])
