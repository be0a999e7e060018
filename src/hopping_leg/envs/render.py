"""Pictures of a simulated leg, where OpenGL is to be had."""

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from hopping_leg.errors import UsageError
from hopping_leg.robot import build_model
from hopping_leg.sim import MujocoSimulator

Image = npt.NDArray[np.uint8]


class Camera:
    """Draws one of many legs from the side.

    Args:
        legs: The simulations.
        width: Of the picture, pixels.
        height: Of the picture, pixels.

    Raises:
        UsageError: This computer offers no OpenGL.
    """

    def __init__(self, legs: MujocoSimulator, width: int = 640, height: int = 480) -> None:
        self.legs = legs
        self._model = build_model(legs.robot)
        self._data = mujoco.MjData(self._model)
        try:
            self._renderer: Any = mujoco.Renderer(self._model, height, width)
        except Exception as error:  # each OpenGL backend raises its own kind
            raise UsageError(
                f"Pictures need OpenGL, which is not available here ({error});"
                " install a driver and set MUJOCO_GL=egl or MUJOCO_GL=osmesa, or do not render."
            ) from error

    def picture(self, leg: int = 0) -> Image:
        """Return an RGB picture of a leg, (height, width, 3)."""
        self._data.qpos[0] = self.legs.height[leg]
        self._data.qpos[1:] = self.legs.q[leg]
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, camera="side")
        image: Image = self._renderer.render()
        return image

    def close(self) -> None:
        """Free the OpenGL context."""
        self._renderer.close()
