"""Short videos of hops side by side, rendered off screen in a process of its own.

OpenGL drivers crash, hang or are missing; none of that may take an evaluation down. MuJoCo chooses
OpenGL's back end when it is imported: EGL there, unless MUJOCO_GL names another.
"""

import functools
import io
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from hopping_leg.evaluate import metrics, trials
from hopping_leg.figures import COMMAND, controller_colours, rgb
from hopping_leg.robot import Robot, get_spec
from hopping_leg.trace import Trace

CLIP_SECONDS = 1.2
FRAME_RATE = 33.3  # frames per second of simulated time
SLOWDOWN = 2.0
SIZE = (380, 400)  # width and height of one leg's picture, pixels
_TIMEOUT = 240.0  # s


@dataclass(frozen=True)
class Clip:
    """What one picture of a video shows."""

    name: str
    """Who hops."""
    colour: str
    """Of the motors and the name, ``#rrggbb``."""
    poses: list[list[float]]
    """Height, hip and knee, m and rad, and the commanded height, m, of each frame."""


@dataclass(frozen=True)
class Video:
    """An animation, or the reason why there is none."""

    content: bytes | None
    reason: str = ""


def render_videos(robot: Robot, runs: Sequence[trials.Run]) -> dict[str, Video]:
    """Render a video per controller: hops of its first fixed trial at each command, half speed."""
    colours = controller_colours(run.controller for run in runs)
    clips: dict[str, list[Clip]] = {}
    for run in runs:
        if run.trial.kind == "fixed" and run.repeat == 0:
            poses = sample(run.trace, metrics.START_SECONDS, CLIP_SECONDS)
            own = clips.setdefault(run.controller, [])
            own.append(Clip(run.controller, colours[run.controller], poses))
    with ThreadPoolExecutor() as pool:
        shown = functools.partial(render_clips, robot, milliseconds=1000 * SLOWDOWN / FRAME_RATE)
        return dict(zip(clips, pool.map(shown, clips.values()), strict=True))


def sample(
    trace: Trace, start: float, seconds: float, rate: float = FRAME_RATE
) -> list[list[float]]:
    """Return the poses of a ``Clip`` at some frames per second from a time of a run on, s."""
    time = trace.column("time_s")
    moments = start + np.arange(round(seconds * rate)) / rate
    names = ("height_m", "hip_position_rad", "knee_position_rad")
    pose = [np.interp(moments, time, trace.column(name)) for name in names]
    now = np.clip(np.searchsorted(time, moments + 1e-9, side="right") - 1, 0, None)
    rows: list[list[float]] = np.stack([*pose, trace.column("command_m")[now]], axis=1).tolist()
    return rows


def render_clips(robot: Robot, clips: Sequence[Clip], milliseconds: float) -> Video:
    """Render clips of the same length side by side, each frame shown so long."""
    spec, box = get_spec(robot), mujoco.mjtGeom.mjGEOM_BOX
    grey = [*(part / 255 for part in rgb(COMMAND)), 1.0]
    line = spec.worldbody.add_body(mocap=True)  # the commanded height of the hip, behind the leg
    line.add_geom(type=box, size=[0.25, 0.001, 0.0015], rgba=grey, contype=0, conaffinity=0)
    spec.compile()
    asked = {"leg": spec.to_xml(), "clips": [asdict(clip) for clip in clips]}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "hopping_leg.evaluate.video"],
            env={"MUJOCO_GL": "egl", **os.environ},
            input=json.dumps({**asked, "milliseconds": round(milliseconds)}).encode(),
            capture_output=True,
            timeout=_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Video(None, f"it took longer than {_TIMEOUT:.0f} s")
    if done.returncode == 0:
        return Video(done.stdout)
    lines = done.stderr.decode(errors="replace").splitlines()
    said = [line for line in lines if line.strip() and line[0] != " "]
    reason = said[-1] if said else f"the renderer ended with code {done.returncode}"
    return Video(None, f"{reason} (Mesa's libegl1 would do, or MUJOCO_GL=osmesa and libosmesa6)")


def _main() -> None:
    """Read what ``render_clips`` asks for, write the animation."""
    asked = json.load(sys.stdin)
    clips = [Clip(**clip) for clip in asked["clips"]]
    first, *others = _draw_frames(mujoco.MjModel.from_xml_string(asked["leg"]), clips)
    look = {"duration": asked["milliseconds"], "loop": 0, "quality": 60}
    content = io.BytesIO()
    first.save(content, "webp", save_all=True, append_images=others, **look)
    sys.stdout.buffer.write(content.getvalue())


def _draw_frames(model: mujoco.MjModel, clips: Sequence[Clip]) -> list[Image.Image]:
    """Return one picture per frame with all clips side by side."""
    data, poses = mujoco.MjData(model), np.array([clip.poses for clip in clips])
    housing = model.material("housing").rgba
    highest = float(poses[..., [0, 3]].max())
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [0.02, 0.0, 0.48 * highest]
    camera.azimuth, camera.elevation = 90.0, -4.0
    camera.distance = 0.35 + 1.25 * highest
    width, height = SIZE
    font = ImageFont.load_default(16)
    pictures = []
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        for frame in range(poses.shape[1]):
            picture = Image.new("RGB", (width * len(clips), height))
            draw = ImageDraw.Draw(picture)
            for column, clip in enumerate(clips):
                *data.qpos[:], command = poses[column, frame]
                data.mocap_pos[0] = 0.0, 0.06, command
                housing[:3] = np.array(rgb(clip.colour)) / 255
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera)
                picture.paste(Image.fromarray(renderer.render()), (column * width, 0))
                at = column * width + 12
                draw.text((at, 8), clip.name, clip.colour, font, stroke_width=0.4)
                text = f"command {command:.2f} m    hip axis {data.qpos[0]:.2f} m"
                draw.text((at, 30), text, (40, 40, 40), font)
            pictures.append(picture)
    return pictures


if __name__ == "__main__":
    _main()
