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
    """Handles of one leg.

    Attributes:
        root: Everything of the leg.
        base: Slides on the rail.
        thigh: Turns about the hip.
        shank: Turns about the knee.
    """

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
    """Put a leg into the scene.

    Args:
        server: Whose scene.
        name: Path in the scene.
        robot: Its geometry.
        x: Where its rail stands, m.
        colour: Of its motors.
    """
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
    rgba = model.mat_rgba[model.geom_matid[geom]]
    red, green, blue = (int(255 * value) for value in rgba[:3])
    rgb = (red, green, blue)
    at = tuple(model.geom_pos[geom])
    turned = tuple(model.geom_quat[geom])
    kind = model.geom_type[geom]
    scene = server.scene
    if name in _HOUSINGS:
        width = 1.1 * size[0] if name == "base" else 1.8 * size[0]
        scene.add_cylinder(path, size[0], width, colour, wxyz=_ACROSS, position=at, **PLAIN)
        scene.add_cylinder(
            f"{path}_axle",
            0.35 * size[0],
            width + 0.008,
            (235, 238, 242),
            wxyz=_ACROSS,
            position=at,
            **PLAIN,
        )
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        scene.add_icosphere(path, size[0], rgb, position=at, **PLAIN)
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        scene.add_box(path, rgb, tuple(2 * size), position=at, wxyz=turned, **PLAIN)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        scene.add_cylinder(path, size[0], 2 * size[1], rgb, position=at, wxyz=turned, **PLAIN)


def _turned(angle: float) -> Array:
    """Return the rotation by a joint angle about the joints' axis, which is -y."""
    return np.array([math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0])
