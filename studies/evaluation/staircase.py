"""The README's animation: the best policy and energy shaping follow one staircase side by side.

``python -m studies.evaluation.staircase`` writes ``figures/staircase.webp``, in real time.
"""

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageSequence

from hopping_leg.cli import DEMO
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.trials import STAIRCASE, scaled
from hopping_leg.evaluate.video import SIZE, Clip, render_clips, sample
from hopping_leg.figures import COMMAND, controller_colours, encode, styled
from hopping_leg.io import write_atomically
from hopping_leg.robot import load_robot
from hopping_leg.trace import Trace

OUT = Path(__file__).parent / "figures" / "staircase.webp"
STEP_SECONDS = 2.0
FRAME_RATE = 50 / 3
SEED = 1000
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
    clips = [
        Clip(name, colour, sample(traces[name], 0.0, stairs.seconds, FRAME_RATE))
        for name, colour in controller_colours(names).items()
    ]
    video = render_clips(robot, clips, 1000 / FRAME_RATE)
    if video.content is None:
        raise UsageError(f"The legs cannot be rendered: {video.reason}.")
    legs = [f.convert("RGB") for f in ImageSequence.Iterator(Image.open(io.BytesIO(video.content)))]
    frames = with_curves(legs, draw_curves(traces))
    content = io.BytesIO()
    duration = round(1000 / FRAME_RATE)
    frames[0].save(
        content, "WEBP", save_all=True, append_images=frames[1:], duration=duration, loop=0,
        quality=QUALITY, method=4,
    )  # fmt: skip
    write_atomically(OUT, content.getvalue())
    print(f"Wrote {OUT}, {len(content.getvalue()) / 1e6:.2f} MB.")


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
