"""Render poses to an animation: ``python -m hopping_leg.evaluate.render XML NPY OUT M...``.

Runs as its own process, because the OpenGL backend is fixed when MuJoCo is imported.
"""

import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from hopping_leg.arrays import Array
from hopping_leg.evaluate.video import FRAME_RATE, SLOWDOWN

SIZE = (220, 300)
"""Width and height of one command's picture, pixels."""

_ENCODING: dict[str, dict[str, Any]] = {
    ".webp": {"quality": 60, "method": 4},
    ".gif": {"optimize": True},
}
"""By the file's ending."""

_COMMAND_RGBA = np.array([0.84, 0.37, 0.0, 0.8], dtype=np.float32)


def main(arguments: list[str]) -> None:
    """Render; arguments as in the module's docstring."""
    model = mujoco.MjModel.from_xml_path(arguments[0])
    poses = np.load(arguments[1], allow_pickle=False)
    commands = [float(text) for text in arguments[3:]]
    frames = render(model, poses, commands)
    out = Path(arguments[2])
    frames[0].save(
        out,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 * SLOWDOWN / FRAME_RATE),
        loop=0,
        **_ENCODING[out.suffix],
    )


def render(model: mujoco.MjModel, poses: Array, commands: list[float]) -> list[Image.Image]:
    """Return one picture per frame with all commands side by side.

    Args:
        model: The leg.
        poses: Height, hip and knee, m and rad, (commands, frames, 3).
        commands: Desired heights, m.
    """
    data = mujoco.MjData(model)
    camera = _camera(float(poses[..., 0].max()))
    width, height = SIZE
    pictures = []
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        for frame in range(poses.shape[1]):
            picture = Image.new("RGB", (width * len(commands), height))
            for column, command in enumerate(commands):
                data.qpos[:] = poses[column, frame]
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera)
                _mark(renderer.scene, command)
                picture.paste(Image.fromarray(renderer.render()), (column * width, 0))
            _label(picture, poses[:, frame, 0], commands)
            pictures.append(picture)
    return pictures


def _camera(highest: float) -> mujoco.MjvCamera:
    """Return a camera that looks along the hip's axis and keeps the highest base in view."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [0.02, 0.0, 0.5 * highest]
    camera.azimuth, camera.elevation = 90.0, -4.0
    camera.distance = 0.35 + 1.25 * highest
    return camera


def _mark(scene: mujoco.MjvScene, command: float) -> None:
    """Draw the commanded height of the hip axis as a thin line behind the leg."""
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_BOX,
        np.array([0.25, 0.001, 0.0012]),
        np.array([0.0, 0.06, command]),
        np.eye(3).ravel(),
        _COMMAND_RGBA,
    )
    scene.ngeom += 1


def _label(picture: Image.Image, heights: Array, commands: list[float]) -> None:
    draw = ImageDraw.Draw(picture)
    for column, (height, command) in enumerate(zip(heights, commands, strict=True)):
        text = f"command {command:.2f} m   hip axis {height:.2f} m"
        draw.text((column * SIZE[0] + 8, 6), text, fill=(40, 40, 40))


if __name__ == "__main__":
    main(sys.argv[1:])
