"""Draw the figures of stored traces again.

Give the traces of one controller or of several side by side; what can be drawn from them is drawn:
heights over time, distributions, ladder, phase space, estimated height.

Examples:
  hop plot runs/first/traces/*.parquet --out runs/first/figures
  hop plot runs/first/traces/fast-staircase-0.parquet
  hop plot runs/first/traces/*-fixed-*.parquet --format png
  hop plot runs/first/traces/*.parquet --format pdf --width column
  hop plot runs/first/traces/*-fixed-*.parquet --animation gif
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from hopping_leg.deploy.flight_recorder import SUFFIX, recover
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.figures.paper import Format, Width, encode
from hopping_leg.evaluate.gallery import draw_gallery, run_of
from hopping_leg.evaluate.runs import Run
from hopping_leg.evaluate.tables import tabulate
from hopping_leg.evaluate.video import Animation, fixed_traces, render_video
from hopping_leg.io import safe_file_name, write_atomically
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class Plot:
    """Which traces, and where the figures go."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files from `hop evaluate --traces DIR` or `hop deploy`; also the .blackbox that a
    killed `hop deploy` leaves, whose trace is then written beside it."""
    out: Path = Path("figures")
    """Folder for the figures."""
    format: Format = "svg"
    """Kind of file."""
    width: Width = "screen"
    """What a figure shall fill: a screen, or a column (3.5 in) or page (7.16 in) of a paper."""
    animation: Animation | None = None
    """Also render a hop at each command, side by side at half speed, one file per controller; needs
    OpenGL and traces of a shipped robot."""


def run(args: Plot) -> None:
    """Draw and write every figure that the traces allow."""
    if not args.traces:
        raise UsageError("No trace was named; record some with `hop evaluate ... --traces DIR`.")
    runs = [run_of(_trace(path)) for path in args.traces]
    controllers = list(dict.fromkeys(run.controller for run in runs))
    evaluation = tabulate(runs, controllers, seed=0)
    console = Console()
    for picture in draw_gallery(evaluation, runs):
        path = args.out / f"{picture.name}.{args.format}"
        write_atomically(path, encode(picture.figure, args.format, args.width))
        console.print(f"{picture.title}: {path}", highlight=False)
    if args.animation is not None:
        for name in controllers:
            path = args.out / f"hops-{safe_file_name(name)}.{args.animation}"
            write_atomically(path, _animation(runs, name, args.animation))
            console.print(f"Hops of {name}: {path}", highlight=False)


def _animation(runs: Sequence[Run], controller: str, kind: Animation) -> bytes:
    traces = fixed_traces(runs, controller)
    if not traces:
        raise UsageError(
            f"No trace of {controller} holds one command throughout, which an animation needs; name"
            " some of its 'fixed' ones."
        )
    robot = load_robot(str(next(iter(traces.values())).header.get("robot", "")))
    video = render_video(robot, traces, kind)
    if video.content is None:
        raise UsageError(f"The hops of {controller} cannot be rendered: {video.reason}.")
    return video.content


def _trace(path: Path) -> Path:
    """Return the trace of a run; that of a black box is made first."""
    if path.suffix != SUFFIX:
        return path
    trace = path.with_suffix(".parquet")
    recover(path).save(trace)
    return trace
