"""Draw what stored traces show: heights over time, distributions, ladder, phase space.

Examples:
  hop report runs/first/traces/*.parquet --out runs/first/figures
  hop report runs/first/traces/*-fixed-*.parquet --format pdf
  hop report runs/first/traces/*-fixed-*.parquet --animation gif
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from hopping_leg import errors, io
from hopping_leg.cli.options import say
from hopping_leg.robot import load_robot
from hopping_leg.terminal import said_if_slow

if TYPE_CHECKING:
    from hopping_leg.evaluate import trials


@dataclass(frozen=True)
class Report:
    """Draw the figures of stored traces."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files from `hop evaluate --traces DIR` or `hop deploy`; also the .blackbox that a
    killed `hop deploy` leaves, whose trace is then written beside it."""
    out: Path = Path("figures")
    """Folder for the figures."""
    format: Literal["svg", "pdf", "png"] = "svg"
    """Kind of file."""
    animation: Literal["gif", "webp"] | None = None
    """Also render a hop at each command, side by side at half speed, one file per controller; needs
    OpenGL and traces of a shipped robot."""


def run(args: Report) -> None:
    """Draw figures."""
    with said_if_slow("Reading and drawing."):
        _draw(args)


def _draw(args: Report) -> None:
    from hopping_leg.evaluate import report, result, trials
    from hopping_leg.figures import controller_colours, encode

    if not args.traces:
        raise errors.UsageError(
            "No trace was named; record some with `hop evaluate ... --traces DIR`."
        )
    runs = [trials.load_run(_trace(path)) for path in args.traces]
    controllers = list(dict.fromkeys(run.controller for run in runs))
    for picture in report.draw_report_figures(result.tabulate(runs, controllers, seed=0), runs):
        path = args.out / f"{picture.name}.{args.format}"
        io.write_atomically(path, encode(picture.figure, args.format))
        say(f"{picture.title}: {path}")
    if args.animation is not None:
        for name, colour in controller_colours(controllers).items():
            path = args.out / f"hops-{io.safe_file_name(name)}.{args.animation}"
            io.write_atomically(path, _animation(runs, name, colour, args.animation))
            say(f"Hops of {name}: {path}")


def _animation(
    runs: "Sequence[trials.Run]", controller: str, colour: str, kind: Literal["gif", "webp"]
) -> bytes:
    from hopping_leg.evaluate.video import fixed_traces, render_hops

    traces = fixed_traces(runs, controller)
    if not traces:
        raise errors.UsageError(
            f"No trace of {controller} holds one command throughout, which an animation needs; name"
            " some of its 'fixed' ones."
        )
    robot = load_robot(str(next(iter(traces.values())).header.get("robot", "")))
    video = render_hops(robot, controller, colour, traces, kind)
    if video.content is None:
        raise errors.UsageError(f"The hops of {controller} cannot be rendered: {video.reason}.")
    return video.content


def _trace(path: Path) -> Path:
    from hopping_leg.flight_recording import SUFFIX, recover

    if path.suffix != SUFFIX:
        return path
    trace = path.with_suffix(".parquet")
    recover(path).save(trace)
    return trace
