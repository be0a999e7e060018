"""Draw stored traces, and set stored runs on a page, one alone or several beside each other.

`figures` draws what can be drawn from traces: heights over time, distributions, ladder, phase
space, estimated height. `page` writes one self-contained HTML page: the report of an evaluation
again, or evaluations and trainings beside each other, with what differs in their conditions said.

Examples:
  hop report figures runs/first/traces/*.parquet --out runs/first/figures
  hop report figures runs/first/traces/*-fixed-*.parquet --format pdf --width column
  hop report figures runs/first/traces/*-fixed-*.parquet --animation gif
  hop report page runs/first
  hop report page old=runs/first/evaluation.json new=runs/second --out runs/comparison.html
  hop report page runs/fast-seed0 runs/fast-seed1 --json runs/comparison.json
"""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from hopping_leg import errors, figure_style, io
from hopping_leg.cli.options import JsonFile, save_json, say, say_written
from hopping_leg.colours import controller_colours
from hopping_leg.deploy.flight_recorder import SUFFIX, recover
from hopping_leg.evaluate import aggregation, comparison, report, result_files, runner, trials
from hopping_leg.evaluate.video import Animation, fixed_traces, render_hops
from hopping_leg.progress import said_if_slow
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class Figures:
    """Draw the figures of stored traces."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files from `hop evaluate --traces DIR` or `hop deploy`; also the .blackbox that a
    killed `hop deploy` leaves, whose trace is then written beside it."""
    out: Path = Path("figures")
    """Folder for the figures."""
    format: figure_style.Format = "svg"
    """Kind of file."""
    width: figure_style.Width = "screen"
    """Width of the figures: a screen, or a column (3.5 in) or page (7.16 in) of a paper."""
    animation: Animation | None = None
    """Also render a hop at each command, side by side at half speed, one file per controller; needs
    OpenGL and traces of a shipped robot."""


@dataclass(frozen=True)
class Page:
    """Write the page of a stored evaluation, or of several runs beside each other."""

    runs: tyro.conf.Positional[tuple[str, ...]]
    """Folders or JSON files of `hop evaluate`, folders of finished trainings; LABEL=PATH chooses
    the name in all tables."""
    out: Path = Path("report.html")
    """File for the page."""
    json: JsonFile = None


def run(args: Figures | Page) -> None:
    """Draw figures or write a page."""
    with said_if_slow("Reading and drawing."):
        if isinstance(args, Figures):
            _draw(args)
        else:
            _write(args)


def _write(args: Page) -> None:
    runs = result_files.read_runs(args.runs)
    if len(runs) == 1 and (evaluation := runs[0].evaluation):
        traces = sorted(runs[0].traces.glob("*.parquet")) if runs[0].traces else []
        page = report.write_report(
            runner.EvaluationRun(evaluation, [trials.load_run(path) for path in traces])
        )
        numbers = evaluation.to_json()
    else:
        compared = comparison.set_beside(runs)
        command = shlex.join(["hop", "report", "page", *args.runs, "--out", str(args.out)])
        page = comparison.write_comparison(compared, command)
        numbers = {"command": command, **compared.to_json()}
        say(*compared.notes)
    io.write_atomically(args.out, page)
    save_json(args.json, numbers)
    say_written(args.out, args.json)


def _draw(args: Figures) -> None:
    if not args.traces:
        raise errors.UsageError(
            "No trace was named; record some with `hop evaluate ... --traces DIR`."
        )
    runs = [trials.load_run(_trace(path)) for path in args.traces]
    controllers = list(dict.fromkeys(run.controller for run in runs))
    for picture in report.draw_report_figures(
        aggregation.tabulate(runs, controllers, seed=0), runs
    ):
        path = args.out / f"{picture.name}.{args.format}"
        io.write_atomically(path, figure_style.encode(picture.figure, args.format, args.width))
        say(f"{picture.title}: {path}")
    if args.animation is not None:
        for name, colour in controller_colours(controllers).items():
            path = args.out / f"hops-{io.safe_file_name(name)}.{args.animation}"
            io.write_atomically(path, _animation(runs, name, colour, args.animation))
            say(f"Hops of {name}: {path}")


def _animation(runs: Sequence[trials.Run], controller: str, colour: str, kind: Animation) -> bytes:
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
    if path.suffix != SUFFIX:
        return path
    trace = path.with_suffix(".parquet")
    recover(path).save(trace)
    return trace
