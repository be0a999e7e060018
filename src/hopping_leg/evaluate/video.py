"""A short video of a hop at every command, rendered off screen in a process of its own.

OpenGL drivers crash, hang or are missing; none of that may take an evaluation down.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.evaluate.trials import Run
from hopping_leg.hop_detection import trace_hops
from hopping_leg.robot import Robot, get_spec
from hopping_leg.trace import Trace

Animation = Literal["webp", "gif"]
"""Kinds of files that move."""

BACKENDS = ("egl", "osmesa")
"""Ways to OpenGL without a screen, in the order of trying."""

CLIP_SECONDS = 1.2
FRAME_RATE = 33.3
"""Frames per second of simulated time."""

SLOWDOWN = 2.0
TIMEOUT = 120.0
"""Given to one backend, s."""


@dataclass(frozen=True)
class Video:
    """An animation, or the reason why there is none.

    Attributes:
        content: The file, or None.
        reason: What stood in the way, empty if nothing did.
    """

    content: bytes | None
    reason: str = ""


def fixed_traces(runs: Sequence[Run], controller: str) -> dict[float, Trace]:
    """Return a controller's first run at each command, m."""
    return {
        run.trial.steps[0][0]: run.trace
        for run in runs
        if run.controller == controller and run.trial.kind == "fixed" and run.repeat == 0
    }


def render_video(robot: Robot, traces: Mapping[float, Trace], kind: Animation = "webp") -> Video:
    """Render a hop at every command side by side, at half speed.

    Args:
        robot: The leg.
        traces: Command in m to a run at it.
        kind: Kind of file.
    """
    commands = list(traces)
    poses = np.stack([clip(trace) for trace in traces.values()])
    with tempfile.TemporaryDirectory() as folder:
        model, motion, out = (Path(folder) / n for n in ("leg.xml", "poses.npy", f"hops.{kind}"))
        spec = get_spec(robot)
        spec.compile()
        model.write_text(spec.to_xml(), encoding="utf-8")
        np.save(motion, poses)
        reasons = []
        for backend in _backends():
            reason = _render(backend, model, motion, out, commands)
            if reason is None:
                return Video(out.read_bytes())
            reasons.append(f"{backend}: {reason}")
    return Video(None, f"{'; '.join(reasons)} (Mesa's libegl1 or libosmesa6 would do)")


def _backends() -> tuple[str, ...]:
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    return (chosen,) if chosen else BACKENDS


def clip(trace: Trace) -> Array:
    """Return the poses of a clip that begins at the first apex after the start.

    Returns:
        Height, hip and knee, m and rad, (frames, 3).
    """
    time = trace.column("time_s")
    names = ("height_m", "hip_position_rad", "knee_position_rad")
    pose = np.stack([trace.column(name) for name in names], axis=1)
    hops = trace_hops(trace)
    settled = time[hops.tick][time[hops.tick] >= START_SECONDS]
    start = settled[0] if len(settled) else min(START_SECONDS, time[-1])
    moments = start + np.arange(round(CLIP_SECONDS * FRAME_RATE)) / FRAME_RATE
    return np.stack([np.interp(moments, time, column) for column in pose.T], axis=1)


def _render(
    backend: str, model: Path, motion: Path, out: Path, commands: list[float]
) -> str | None:
    """Render in another process; return what went wrong or None."""
    command = [sys.executable, "-m", "hopping_leg.evaluate.render"]
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
