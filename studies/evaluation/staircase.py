"""The README's animation: the best policy and energy shaping follow one staircase side by side.

``python -m studies.evaluation.staircase`` writes ``figures/staircase.webp``, in real time; without
a screen it needs ``MUJOCO_GL=egl``.
"""

import io
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from hopping_leg.cli import DEMO
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.evaluate.trials import STAIRCASE, scaled
from hopping_leg.figures import COMMAND, controller_colours, encode, rgb, styled
from hopping_leg.io import write_atomically
from hopping_leg.robot import Robot, get_spec, load_robot
from hopping_leg.trace import Trace

OUT = Path(__file__).parent / "figures" / "staircase.webp"
STEP_SECONDS = 2.0
FRAME_RATE = 50 / 3
SEED = 1000
SIZE = (380, 400)  # width and height of one leg's picture, pixels
STRIP = 190  # height of the curves, pixels
WIDTH = 560  # pixels
QUALITY = 35
_DPI = 100


def main() -> None:
    """Hop, render and write the file."""
    names = DEMO
    robot = load_robot(robot_of(names))
    stairs = CommandSchedule(tuple((c, STEP_SECONDS) for c in scaled(STAIRCASE, robot)))
    setup = RolloutConfig(robot)
    commands = stairs.commands(setup.rate)[:, None]
    traces = {
        name: rollout(load_controller(name, robot), setup, commands, seed=SEED).trace(0)
        for name in names
    }
    frames = with_curves(draw_legs(robot, traces, stairs.seconds), draw_curves(traces))
    content = io.BytesIO()
    duration = round(1000 / FRAME_RATE)
    frames[0].save(
        content, "WEBP", save_all=True, append_images=frames[1:], duration=duration, loop=0,
        quality=QUALITY, method=4,
    )  # fmt: skip
    write_atomically(OUT, content.getvalue())
    print(f"Wrote {OUT}, {len(content.getvalue()) / 1e6:.2f} MB.")


def draw_legs(robot: Robot, traces: dict[str, Trace], seconds: float) -> list[Image.Image]:
    """Return a picture per frame with the legs side by side, each before a bar at its command."""
    spec, box = get_spec(robot), mujoco.mjtGeom.mjGEOM_BOX
    grey = [*(part / 255 for part in rgb(COMMAND)), 1.0]
    bar = spec.worldbody.add_body(mocap=True)
    bar.add_geom(type=box, size=[0.25, 0.001, 0.0015], rgba=grey, contype=0, conaffinity=0)
    model = spec.compile()
    data, housing = mujoco.MjData(model), model.material("housing").rgba
    highest = max(float(trace.column("height_m").max()) for trace in traces.values())
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [0.02, 0.0, 0.48 * highest]
    camera.azimuth, camera.elevation, camera.distance = 90.0, -4.0, 0.35 + 1.25 * highest
    names = ("height_m", "hip_position_rad", "knee_position_rad", "command_m")
    width, height = SIZE
    font, pictures = ImageFont.load_default(16), []
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        for moment in np.arange(round(seconds * FRAME_RATE)) / FRAME_RATE:
            picture = Image.new("RGB", (width * len(traces), height))
            draw = ImageDraw.Draw(picture)
            for column, (name, colour) in enumerate(controller_colours(traces).items()):
                tick = np.searchsorted(traces[name].column("time_s"), moment + 1e-9) - 1
                *data.qpos[:], command = (traces[name].column(what)[tick] for what in names)
                data.mocap_pos[0] = 0.0, 0.06, command
                housing[:3] = np.array(rgb(colour)) / 255
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera)
                picture.paste(Image.fromarray(renderer.render()), (column * width, 0))
                at = column * width + 12
                draw.text((at, 8), name, colour, font, stroke_width=0.4)
                text = f"command {command:.2f} m    hip axis {data.qpos[0]:.2f} m"
                draw.text((at, 30), text, (40, 40, 40), font)
            pictures.append(picture)
    return pictures


@styled
def draw_curves(traces: dict[str, Trace]) -> Figure:
    """Draw the base heights over time under the command."""
    figure = Figure(figsize=(len(traces) * SIZE[0] / _DPI, STRIP / _DPI))
    axes = figure.add_axes((0.075, 0.23, 0.91, 0.72))
    for name, colour in controller_colours(traces).items():
        time, height = (traces[name].column(column) for column in ("time_s", "height_m"))
        axes.plot(time, height, color=colour, linewidth=1.4)
    axes.step(time, traces[name].column("command_m"), color=COMMAND, where="post", linewidth=1.6)
    axes.set(xlabel="time / s", ylabel="hip axis / m", xlim=(0, time[-1]))
    return figure


def with_curves(legs: list[Image.Image], curves: Figure) -> list[Image.Image]:
    """Put the curves under the legs, up to the time of each frame."""
    whole = Image.open(io.BytesIO(encode(curves, "png", _DPI))).convert("RGB")
    axes = curves.axes[0]
    ends = axes.transData.transform(
        np.array([(x, y) for x in axes.get_xlim() for y in axes.get_ylim()])
    )
    left, right = ends[0, 0] + 1, ends[-1, 0] + 1
    bottom, top = STRIP - ends[0, 1] - 1, STRIP - ends[-1, 1]
    frames = []
    for number, picture in enumerate(legs):
        now = left + (right - left) * (number + 1) / len(legs)
        strip = whole.copy()
        ImageDraw.Draw(strip).rectangle((now, top, right, bottom - 1), fill="white")
        frame = Image.new("RGB", (picture.width, picture.height + STRIP), "white")
        frame.paste(picture, (0, 0))
        frame.paste(strip, (0, picture.height))
        frames.append(frame.resize((WIDTH, round(frame.height * WIDTH / frame.width))))
    return frames


if __name__ == "__main__":
    main()
