"""Identify a leg from recordings: a robot file, a JSON file and a report.

The rig is recognised from a recording's header, sidecar or columns. Without --validate a quarter
of each recording is held out and judges the fit.

Examples:
  hop identify fixed-base.parquet moving-base.parquet --out my_leg.toml --report report.html
  hop identify run1.csv.gz run2.csv.gz --validate run3.csv.gz --out leg.toml --json leg.json
  hop identify fixed-base.parquet moving-base.parquet --search two-pass --out paper.toml
  hop identify run1.csv.gz run2.csv.gz --json leg.json --posterior 100
  hop identify run1.csv.gz --parameters hip.friction knee.friction --bounds hip.friction=0,0.5
"""

from dataclasses import dataclass
from pathlib import Path

import tyro

from hopping_leg import errors, io
from hopping_leg.cli import COMMAND
from hopping_leg.cli.options import JsonFile, save_json, say, say_written, show_table
from hopping_leg.robot import load_robot
from hopping_leg.terminal import Progress


@dataclass(frozen=True)
class Identify:
    """What to identify from what, and where to put it."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """Recordings to fit to: Parquet, or CSV with a sidecar or of a known rig."""
    validate: tuple[Path, ...] = ()
    """Recordings that judge the fit; default: a quarter of each fitted one is held out."""
    robot: str | None = None
    """Where the fit begins: a shipped robot or a .toml file; default: the recordings' own."""
    seed: int = 0
    """Seed of the split and the search."""
    out: Path = Path("identified.toml")
    """Robot file to write; its name without .toml is the robot's."""
    json: JsonFile = None
    report: Path | None = None
    """Write the report to this file as one HTML page."""
    search: str | None = None
    """`least-squares` (default), `cma`, or the paper's `two-pass`."""
    parameters: tuple[str, ...] | None = None
    """What to fit, e.g. `hip.friction,drive.delay`; default: what these recordings may tell. With
    `two-pass` they are fitted besides Table I."""
    bounds: tuple[str, ...] = ()
    """Bounds in SI units, e.g. `--bounds hip.friction=0,0.5 drive.delay=0,0.01`."""
    generations: int = 100
    """Generations of CMA-ES, in each pass."""
    population: int = 16
    """Candidates in a generation of CMA-ES."""
    posterior: int = 0
    """Draws of all parameters that the recordings allow, for --json; 0 writes none."""
    threads: int = 0
    """Threads of the physics; 0 takes every core. They change no bit of the result."""
    ray: str | None = None
    """Simulate on the Ray cluster at this address; `local` starts one on this machine."""


def run(args: Identify) -> None:
    """Identify a leg."""
    from hopping_leg.identify import plan, recording, result
    from hopping_leg.identify.optimizers import SearchOptions
    from hopping_leg.identify.pipeline import IdentifyOptions, identify

    effort = SearchOptions(generations=args.generations, population=args.population)
    options = IdentifyOptions(
        parameters=args.parameters, bounds=dict(_bounds(text) for text in args.bounds),
        search=args.search, effort=effort, threads=args.threads, ray=args.ray,
    )  # fmt: skip
    if not args.recordings:
        raise errors.UsageError("No recording was named; make one with `hop record`.")
    recordings = [recording.load_recording(path) for path in args.recordings]
    judges = [recording.load_recording(path) for path in args.validate]
    origin = args.robot or plan.robot_of([*recordings, *judges])
    _check_outputs(args, origin)
    if args.posterior < 0 or (args.posterior and args.json is None):
        raise errors.UsageError("--posterior needs a positive number of draws, and --json FILE.")
    robot = load_robot(origin)
    for use, group in (("fit", recordings), ("judge", judges)):
        for r in group:
            about, seconds = f"{r.name}, {r.metadata.rig}", r.time[-1] - r.time[0]
            rate, source = r.metadata.rate_hz, r.metadata.source
            say(f"{use}: {about}, {seconds:.4g} s at {rate:g} Hz, {source}")
            say(*(f"  {warning}" for warning in r.warnings))
    with Progress("preparing") as bar:
        identified = identify(
            recordings, robot, validate=judges, options=options, seed=args.seed,
            report=lambda stage, share, cost: bar.show(stage, share, f"cost {cost:.5g}"),
        )  # fmt: skip
    result.save_robot(identified, args.out, origin)
    warning = result.warning(identified)
    say(*filter(None, (result.verdict(identified), warning, result.at_bounds(identified))))
    show_table(result.PARAMETERS, result.shown_parameters(identified))
    show_table(result.ERRORS, result.shown_errors(identified))
    say(*identified.identifiability.statements)
    numbers = result.as_json(identified, args.posterior)
    save_json(args.json, {"command": COMMAND.get(), **numbers})
    if args.report:
        from hopping_leg.identify.report import write_fit_report

        io.write_atomically(args.report, write_fit_report(identified, COMMAND.get(), args.threads))
    say_written(args.out, args.json, args.report)
    if warning:
        raise errors.PhysicsError(warning)


def _bounds(text: str) -> tuple[str, tuple[float, float]]:
    name, _, pair = text.partition("=")
    try:
        low, high = map(float, pair.split(","))
    except ValueError as error:
        raise errors.UsageError(
            f"'{text}' gives no bounds; write e.g. hip.friction=0,0.5 in SI units."
        ) from error
    return name.strip(), (low, high)


def _check_outputs(args: Identify, origin: str) -> None:
    """Refuse an output that would replace an input, before any time is spent."""
    from hopping_leg.identify.recording_format import sidecar_path

    if args.out.suffix != ".toml":
        raise errors.UsageError(f"--out {args.out} must end in .toml, as robot files do.")
    recordings = (*args.recordings, *args.validate)
    inputs = {p.resolve() for p in (Path(origin), *recordings, *map(sidecar_path, recordings))}
    for path in filter(None, (args.out, args.json, args.report)):
        if path.resolve() in inputs:
            raise errors.UsageError(f"{path} is an input; give another file for the result.")
