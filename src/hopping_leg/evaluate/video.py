"""A short video of a hop at every command, rendered off screen in a process of its own.

OpenGL drivers crash, hang or are missing; none of that may take an evaluation down. That process is
``python -m hopping_leg.evaluate.video XML NPY OUT M...``, as MuJoCo chooses the OpenGL backend when
it is imported.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from hopping_leg.arrays import Array
from hopping_leg.evaluate import metrics, trials
from hopping_leg.hop_detection import trace_hops
from hopping_leg.robot import Robot, get_spec
from hopping_leg.trace import Trace

Animation = Literal["webp", "gif"]
BACKENDS = ("egl", "osmesa")
"""Ways to OpenGL without a screen, in the order of trying."""
CLIP_SECONDS = 1.2
FRAME_RATE = 33.3  # frames per second of simulated time
SLOWDOWN = 2.0
SIZE = (220, 300)  # width and height of one command's picture, pixels
TIMEOUT = 120.0  # given to one backend, s
_ENCODING: dict[str, dict[str, Any]] = {
    ".webp": {"quality": 60, "method": 4},
    ".gif": {"optimize": True},
}
"""By the file's ending."""


@dataclass(frozen=True)
class Video:
    """An animation, or the reason why there is none."""

    content: bytes | None
    reason: str = ""


def fixed_traces(runs: Sequence[trials.Run], controller: str) -> dict[float, Trace]:
    """Return a controller's first run at each command, m."""
    return {
        run.trial.steps[0][0]: run.trace
        for run in runs
        if run.controller == controller and run.trial.kind == "fixed" and run.repeat == 0
    }


def render_video(robot: Robot, traces: Mapping[float, Trace], kind: Animation = "webp") -> Video:
    """Render a hop at every command side by side, at half speed, given a run at each, m."""
    commands = list(traces)
    poses = np.stack([clip(trace) for trace in traces.values()])
    with tempfile.TemporaryDirectory() as folder:
        model, motion, out = (Path(folder) / n for n in ("leg.xml", "poses.npy", f"hops.{kind}"))
        spec = get_spec(robot)
        spec.compile()
        model.write_text(spec.to_xml(), encoding="utf-8")
        np.save(motion, poses)
        reasons = []
        chosen = os.environ.get("MUJOCO_GL", "").lower()
        for backend in (chosen,) if chosen else BACKENDS:
            reason = _render(backend, model, motion, out, commands)
            if reason is None:
                return Video(out.read_bytes())
            reasons.append(f"{backend}: {reason}")
    return Video(None, f"{'; '.join(reasons)} (Mesa's libegl1 or libosmesa6 would do)")


def clip(trace: Trace) -> Array:
    """Return height, hip and knee, m and rad, (frames, 3), from the first apex after the start."""
    time = trace.column("time_s")
    names = ("height_m", "hip_position_rad", "knee_position_rad")
    pose = np.stack([trace.column(name) for name in names], axis=1)
    hops = trace_hops(trace)
    settled = time[hops.tick][time[hops.tick] >= metrics.START_SECONDS]
    start = settled[0] if len(settled) else min(metrics.START_SECONDS, time[-1])
    moments = start + np.arange(round(CLIP_SECONDS * FRAME_RATE)) / FRAME_RATE
    return np.stack([np.interp(moments, time, column) for column in pose.T], axis=1)


def _render(
    backend: str, model: Path, motion: Path, out: Path, commands: list[float]
) -> str | None:
    """Render in another process; return what went wrong or None."""
    command = [sys.executable, "-m", "hopping_leg.evaluate.video"]
    command += [str(model), str(motion), str(out), *(f"{c:.6f}" for c in commands)]
    environment = {**os.environ, "MUJOCO_GL": backend}
    if backend == "osmesa":
        environment["PYOPENGL_PLATFORM"] = "osmesa"
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"took longer than {TIMEOUT:.0f} s"
    if done.returncode == 0 and out.is_file():
        return None
    lines = [line for line in done.stderr.splitlines() if line.strip() and line[0] != " "]
    return lines[-1] if lines else f"the renderer ended with code {done.returncode}"


def _main(arguments: list[str]) -> None:
    """Render poses to a file; arguments as in the module's docstring."""
    model = mujoco.MjModel.from_xml_path(arguments[0])
    poses = np.load(arguments[1], allow_pickle=False)
    frames = _draw_frames(model, poses, [float(text) for text in arguments[3:]])
    out = Path(arguments[2])
    frames[0].save(
        out,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 * SLOWDOWN / FRAME_RATE),
        loop=0,
        **_ENCODING[out.suffix],
    )


def _draw_frames(model: mujoco.MjModel, poses: Array, commands: list[float]) -> list[Image.Image]:
    """Return one picture per frame with all commands side by side; poses (commands, frames, 3)."""
    data = mujoco.MjData(model)
    highest = float(poses[..., 0].max())
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [0.02, 0.0, 0.5 * highest]
    camera.azimuth, camera.elevation = 90.0, -4.0
    camera.distance = 0.35 + 1.25 * highest
    width, height = SIZE
    pictures = []
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        for frame in range(poses.shape[1]):
            picture = Image.new("RGB", (width * len(commands), height))
            draw = ImageDraw.Draw(picture)
            for column, command in enumerate(commands):
                data.qpos[:] = poses[column, frame]
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera)
                _mark(renderer.scene, command)
                picture.paste(Image.fromarray(renderer.render()), (column * width, 0))
                text = f"command {command:.2f} m   hip axis {poses[column, frame, 0]:.2f} m"
                draw.text((column * width + 8, 6), text, fill=(40, 40, 40))
            pictures.append(picture)
    return pictures


def _mark(scene: mujoco.MjvScene, command: float) -> None:
    """Draw the commanded height of the hip axis as a thin line behind the leg."""
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_BOX,
        np.array([0.25, 0.001, 0.0012]),
        np.array([0.0, 0.06, command]),
        np.eye(3).ravel(),
        np.array([0.84, 0.37, 0.0, 0.8], dtype=np.float32),
    )
    scene.ngeom += 1


if __name__ == "__main__":
    _main(sys.argv[1:])
